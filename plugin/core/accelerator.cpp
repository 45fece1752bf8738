#include "accelerator.h"

#include <chrono>
#include <optional>
#include <stdexcept>

#include "builder.h"
#include "packed_tree.h"
#include "tree_file.h"

namespace bsp {
namespace {

Statistics describe(const TriangleSet &set, const Settings &settings) {
    Statistics s;
    s.spec = full_spec(settings);
    s.triangles = set.valid.size();
    s.dropped_triangles = set.dropped();
    return s;
}

/// Every triangle, one at a time, by the same test: the oracle. It shares nothing with the trees but `Test::intersect`.
template <typename Test> class BruteForce final : public Accelerator {
public:
    BruteForce(const TriangleSet &set, Statistics statistics) {
        for (const std::uint32_t id : set.valid)
            m_triangles.push_back({set.triangles[id], id});
        m_statistics = std::move(statistics);
        m_statistics.references = m_triangles.size();
        m_statistics.bytes = m_triangles.size() * sizeof m_triangles[0];
        m_bounds = set.bounds;
    }

    Hit closest(const Ray &ray) const noexcept override {
        Hit best;
        if (!is_usable(ray))
            return best;
        const Test test(ray);
        for (const auto &[triangle, id] : m_triangles)
            if (const auto hit = test.intersect(triangle))
                if (hit->t >= 0 && hit->t <= ray.maxt && (hit->t < best.t || !best.found()))
                    best = {hit->t, hit->u, hit->v, id};
        return best;
    }

    bool any(const Ray &ray) const noexcept override { return closest(ray).found(); }
    std::vector<Plane> planes() const override { return {}; }
    std::vector<MemoryPart> memory() const override {
        return {{m_triangles.data(), m_triangles.size() * sizeof m_triangles[0]}};
    }

    Hit count_closest(const Ray &ray, Counters &counters) const noexcept override {
        ++counters.rays;
        counters.triangle_tests += m_triangles.size();
        return closest(ray);
    }
    bool count_any(const Ray &ray, Counters &counters) const noexcept override {
        return count_closest(ray, counters).found();
    }

private:
    struct Entry {
        Triangle triangle;
        std::uint32_t id;
    };

    static bool is_usable(const Ray &ray) {
        for (unsigned k = 0; k < 3; ++k)
            if (!std::isfinite(ray.o[k]) || !std::isfinite(ray.d[k]))
                return false;
        return !(ray.d == Vec3f{});
    }

    std::vector<Entry> m_triangles;
};

/// The saved tree, if there is one and it is sound.
std::optional<Tree> load(const TreeFile &file, const TriangleSet &set, std::string &warning) {
    try {
        return file.load(set);
    } catch (const std::runtime_error &e) {
        warning = std::string(e.what()) + "; it is built again";
        return {};
    }
}

void save(const TreeFile &file, const Tree &tree, std::string &warning) {
    try {
        file.save(tree);
    } catch (const std::runtime_error &e) {
        warning += (warning.empty() ? "" : "; ") + std::string(e.what());
    }
}

template <typename Test>
std::unique_ptr<Accelerator> make(const TriangleSet &set, const Settings &settings, const BuildOptions &options) {
    Statistics statistics = describe(set, settings);
    if (settings.tree == TreeKind::brute)
        return std::make_unique<BruteForce<Test>>(set, std::move(statistics));
    const auto start = std::chrono::steady_clock::now();
    std::optional<TreeFile> file;
    std::optional<Tree> tree;
    if (!options.cache.empty()) {
        file.emplace(options.cache, set, settings);
        tree = load(*file, set, statistics.warning);
    }
    statistics.loaded = tree.has_value();
    if (!tree)
        tree = build_tree(set, settings, options.monitor);
    statistics.build_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (file && !statistics.loaded)
        save(*file, *tree, statistics.warning);
    return pack_tree<Test, Fault::none>(*tree, set, settings.layout, std::move(statistics));
}

} // namespace

std::unique_ptr<Accelerator> make_accelerator(const TriangleSet &set, const Settings &settings,
                                              const BuildOptions &options) {
    return settings.triangle_test == TriangleTest::woop ? make<WoopTest>(set, settings, options)
                                                        : make<MtTest>(set, settings, options);
}

} // namespace bsp
