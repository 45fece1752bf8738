/// An accelerator made of a tree packed into a node layout.
#pragma once

#include <chrono>
#include <memory>

#include "accelerator.h"
#include "wide_traversal.h"

namespace bsp {

/// A layout and how it is traversed.
template <typename Test, Splits splits, Mode mode> struct BinaryWalk {
    using Layout = BinaryLayout;
    template <typename Query, typename Counting>
    static Query run(const Layout &layout, const ScaledRay &ray, Query query, Counting counting) {
        return traverse<splits, mode, Test>(layout, ray, query, counting);
    }
};
template <typename Test, Simd simd, Mode mode> struct WideWalk {
    using Layout = WideLayout;
    template <typename Query, typename Counting>
    static Query run(const Layout &layout, const ScaledRay &ray, Query query, Counting counting) {
        return WideSearch<simd>::template run<mode, Test>(layout, ray.o, ray.d, query, counting);
    }
};

/// `mixed`: there are primitives among the triangles.
template <typename Walk, bool mixed> class PackedTree final : public Accelerator {
public:
    PackedTree(typename Walk::Layout layout, const TriangleSet &set, Statistics statistics,
               const Primitives *primitives)
        : m_layout(std::move(layout)), m_scale(set.scale), m_primitives(primitives) {
        m_statistics = std::move(statistics);
        for (const MemoryPart &part : m_layout.memory())
            m_statistics.bytes += part.size;
        m_bounds = set.user_bounds();
    }

    Hit closest(const Ray &ray) const noexcept override { return run<ClosestQuery>(ray, NoCounters{}); }
    bool any(const Ray &ray) const noexcept override { return run<AnyQuery>(ray, NoCounters{}); }
    Hit count_closest(const Ray &ray, Counters &counters) const noexcept override {
        return run<ClosestQuery>(ray, CountInto{counters});
    }
    bool count_any(const Ray &ray, Counters &counters) const noexcept override {
        return run<AnyQuery>(ray, CountInto{counters});
    }

    std::vector<Plane> planes() const override {
        std::vector<Plane> planes = planes_of(m_layout);
        for (Plane &plane : planes) {
            if (m_layout.orientation.turns())
                plane = m_layout.orientation.unseen(plane);
            plane.offset = float(m_scale.undo(double(plane.offset)));
        }
        return planes;
    }
    std::vector<MemoryPart> memory() const override { return m_layout.memory(); }

private:
    template <typename Query, typename Counting> auto run(const Ray &ray, Counting counting) const noexcept {
        const ScaledRay own = m_scale.apply(ray);
        if constexpr (mixed) {
            const WithPrimitives<Query> query(own.d[3], {*m_primitives, ray, own});
            return in_users_units(Walk::run(m_layout, own, query, counting).result(), own.per_t);
        } else {
            return in_users_units(Walk::run(m_layout, own, Query(own.d[3]), counting).result(), own.per_t);
        }
    }

    typename Walk::Layout m_layout;
    Scale m_scale;
    const Primitives *m_primitives;
};

/// Packs the tree as the settings say and adds the time that takes to `statistics`; `primitives` is who has those that
/// are no triangles, if the tree is `mixed`. Throws std::length_error if the tree is too large for the layout.
template <typename Test, Mode mode, bool mixed = false>
std::unique_ptr<Accelerator> pack_tree(const Tree &tree, const TriangleSet &set, const Settings &settings,
                                       Statistics statistics, const Primitives *primitives) {
    describe_tree(tree, statistics);
    const auto start = std::chrono::steady_clock::now();
    const auto finish = [&](auto walk, auto layout) -> std::unique_ptr<Accelerator> {
        statistics.phases.pack_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        statistics.build_s += statistics.phases.pack_s;
        return std::make_unique<PackedTree<decltype(walk), mixed>>(std::move(layout), set, std::move(statistics),
                                                                   primitives);
    };
    if (settings.layout == LayoutKind::wide && settings.simd != Simd::avx2 && has_avx512())
        return finish(WideWalk<Test, Simd::avx512, mode>{}, pack_wide(tree, set));
    if (settings.layout == LayoutKind::wide)
        return finish(WideWalk<Test, Simd::avx2, mode>{}, pack_wide(tree, set));
    BinaryLayout layout = pack_binary(tree, set, settings.cached_dots);
    switch (layout.splits) {
    case Splits::axes:
        return finish(BinaryWalk<Test, Splits::axes, mode>{}, std::move(layout));
    case Splits::families:
        return finish(BinaryWalk<Test, Splits::families, mode>{}, std::move(layout));
    case Splits::planes:
        break;
    }
    return finish(BinaryWalk<Test, Splits::planes, mode>{}, std::move(layout));
}

/// The same for a tree with primitives, in the mode `safe`: what they answer has no bound that others could leave out.
template <typename Test>
std::unique_ptr<Accelerator> pack_mixed_tree(const Tree &tree, const TriangleSet &set, const Settings &settings,
                                             Statistics statistics, const Primitives *primitives);

} // namespace bsp
