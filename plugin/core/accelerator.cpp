#include "accelerator.h"

#include <chrono>

#include "binary_tree.h"
#include "builder.h"

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

template <typename Test> std::unique_ptr<Accelerator> make(const TriangleSet &set, const Settings &settings) {
    Statistics statistics = describe(set, settings);
    if (settings.tree == TreeKind::brute)
        return std::make_unique<BruteForce<Test>>(set, std::move(statistics));
    const auto start = std::chrono::steady_clock::now();
    const Tree tree = build_tree(set, settings);
    BinaryLayout layout = pack_binary(tree, set);
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    statistics.build_s = elapsed.count();
    return make_binary_tree<Test, Fault::none>(std::move(layout), tree, set, std::move(statistics));
}

} // namespace

std::unique_ptr<Accelerator> make_accelerator(const TriangleSet &set, const Settings &settings) {
    return settings.triangle_test == TriangleTest::woop ? make<WoopTest>(set, settings) : make<MtTest>(set, settings);
}

} // namespace bsp
