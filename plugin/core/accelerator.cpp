#include "accelerator.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "builder.h"
#include "choice.h"
#include "packed_tree.h"
#include "tree_file.h"

namespace bsp {
namespace {

Statistics describe(const TriangleSet &set, const Settings &settings) {
    Statistics s;
    s.spec = full_spec(settings);
    s.triangles = set.valid.size();
    s.dropped_triangles = set.dropped();
    s.primitives = set.primitives.size();
    return s;
}

/// Every triangle and primitive, one at a time, by the same test: the oracle. It shares nothing with the trees but
/// `Test::intersect` and `PrimitiveQuestion`.
template <typename Test> class BruteForce final : public Accelerator {
public:
    BruteForce(const TriangleSet &set, Statistics statistics, const Primitives *primitives)
        : m_scale(set.scale), m_primitives(primitives), m_boxes(set.primitives.begin(), set.primitives.end()) {
        for (const std::uint32_t id : set.valid)
            m_triangles.push_back({set.triangles[id], id});
        m_statistics = std::move(statistics);
        m_statistics.references = set.size();
        m_statistics.bytes = m_triangles.size() * sizeof m_triangles[0] + m_boxes.size() * sizeof m_boxes[0];
        m_bounds = set.user_bounds();
    }

    Hit closest(const Ray &ray) const noexcept override {
        const ScaledRay scaled = m_scale.apply(ray);
        const Ray own = scaled.ray();
        Hit best;
        const Test test(own);
        for (const auto &[triangle, id] : m_triangles)
            if (const TriangleHit hit = test.template intersect<true>(triangle);
                hit.t() >= 0 && hit.t() <= own.maxt && (hit.t() < best.t || !best.found()))
                best = {hit.t(), hit.u(), hit.v(), id};
        for (std::uint32_t index = 0; own.maxt >= 0 && index < m_boxes.size(); ++index)
            if (const float t = PrimitiveQuestion(*m_primitives, ray, scaled).t(m_boxes[index], index);
                t >= 0 && t <= own.maxt && t < best.t)
                best = {t, 0, 0, primitive_id(index)};
        return in_users_units(best, scaled.per_t);
    }

    bool any(const Ray &ray) const noexcept override { return closest(ray).found(); }
    std::vector<Plane> planes() const override { return {}; }
    std::vector<MemoryPart> memory() const override {
        return {{m_triangles.data(), m_triangles.size() * sizeof m_triangles[0]},
                {m_boxes.data(), m_boxes.size() * sizeof m_boxes[0]}};
    }

    Hit count_closest(const Ray &ray, Counters &counters) const noexcept override {
        ++counters.rays;
        counters.triangle_tests += m_triangles.size() + m_boxes.size();
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

    Scale m_scale;
    std::vector<Entry> m_triangles;
    const Primitives *m_primitives;
    std::vector<PrimitiveBox> m_boxes;
};

void warn(const std::string &sentence, Statistics &statistics) {
    statistics.warning += (statistics.warning.empty() ? "" : "; ") + sentence;
}

/// The saved tree, if there is one and it is sound.
std::optional<Tree> load(const TreeFile &file, const TriangleSet &set, Statistics &statistics) {
    try {
        return file.load(set);
    } catch (const std::runtime_error &e) {
        warn(std::string(e.what()) + "; it is built again", statistics);
        return {};
    }
}

void save(const TreeFile &file, const Tree &tree, Statistics &statistics) {
    try {
        file.save(tree);
    } catch (const std::runtime_error &e) {
        warn(e.what(), statistics);
    }
}

/// A few leaves are capped in many trees, and harmless; where they hold much of the tree, rays are slow.
void warn_of_caps(const Tree &tree, const Settings &settings, Statistics &statistics) {
    constexpr std::size_t worth_a_warning = 10; // percent of the references
    const std::size_t percent = 100 * tree.capped_references / std::max<std::size_t>(1, tree.references.size());
    if (percent < worth_a_warning)
        return;
    std::ostringstream text;
    text << percent << " % of the tree's references are in leaves that were not split further, because there are "
         << "at most " << settings.max_references << " references per triangle (max_references) and "
         << depth_allowed(settings, statistics.triangles) << " levels (max_depth): rays that meet them are slow";
    warn(text.str(), statistics);
}

/// What the mode of traversal is and why, where it is not simply the one that was asked for.
std::string chosen_precision(const Settings &settings, bool with_primitives) {
    if (with_primitives && (settings.precision != Precision::safe || settings.early_exit == EarlyExit::plane))
        return "safe, for a tree of more than triangles has no other mode";
    if (settings.precision == Precision::automatic)
        return "safe, for what rays need depends on where they begin: no scene alone allows less";
    return "";
}

template <typename Test>
std::unique_ptr<Accelerator> make(const TriangleSet &set, const Settings &wanted, const BuildOptions &options) {
    Statistics statistics = describe(set, wanted);
    if (wanted.tree == TreeKind::ize && options.primitives)
        throw std::invalid_argument("the tree ize takes nothing but triangles");
    if (wanted.tree == TreeKind::brute)
        return std::make_unique<BruteForce<Test>>(set, std::move(statistics), options.primitives);
    const auto start = std::chrono::steady_clock::now();
    const auto passed_s = [&] {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    };
    const Choice choice = choose_tree(set, wanted, options.monitor);
    const Settings &settings = choice.settings;
    if (wanted.tree == TreeKind::automatic) {
        statistics.chosen = full_spec(settings);
        statistics.choice = choice.reason;
        statistics.choose_s = passed_s();
        statistics.predicted_build_s = choice.build_s;
        statistics.predicted_trace_s = choice.trace_s;
    }
    std::optional<TreeFile> file;
    std::optional<Tree> tree;
    if (!options.cache.empty()) {
        file.emplace(options.cache, set, settings);
        tree = load(*file, set, statistics);
    }
    statistics.loaded = tree.has_value();
    if (!tree)
        tree = build_tree(set, settings, options.monitor);
    statistics.build_s = passed_s();
    if (file && !statistics.loaded)
        save(*file, *tree, statistics);
    warn_of_caps(*tree, settings, statistics);
    statistics.precision = chosen_precision(settings, options.primitives);
    if (options.primitives)
        return pack_mixed_tree<Test>(*tree, set, settings, std::move(statistics), options.primitives);
    if (settings.early_exit == EarlyExit::plane)
        return pack_tree<Test, Mode::exit_at_plane>(*tree, set, settings, std::move(statistics), nullptr);
    switch (settings.precision) {
    case Precision::fast:
        return pack_tree<Test, Mode::fast>(*tree, set, settings, std::move(statistics), nullptr);
    case Precision::epsilon:
        return pack_tree<Test, Mode::epsilon>(*tree, set, settings, std::move(statistics), nullptr);
    case Precision::automatic:
    case Precision::safe:
        break;
    }
    return pack_tree<Test, Mode::safe>(*tree, set, settings, std::move(statistics), nullptr);
}

} // namespace

std::unique_ptr<Accelerator> make_accelerator(TriangleSet set, const Settings &settings, const BuildOptions &options) {
    set.rescale();
    return settings.triangle_test == TriangleTest::woop ? make<WoopTest>(set, settings, options)
                                                        : make<MtTest>(set, settings, options);
}

} // namespace bsp
