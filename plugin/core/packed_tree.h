/// An accelerator made of a tree packed into a node layout.
#pragma once

#include <chrono>
#include <memory>

#include "accelerator.h"
#include "wide_traversal.h"

namespace bsp {

/// A layout and how it is traversed.
template <typename Test, Splits splits, Fault fault> struct BinaryWalk {
    using Layout = BinaryLayout;
    template <typename Query, typename Counting>
    static void run(const Layout &layout, const Ray &ray, Query &query, Counting counting) {
        traverse<splits, fault, Test>(layout, ray, query, counting);
    }
};
template <typename Test, Fault fault> struct WideWalk {
    using Layout = WideLayout;
    template <typename Query, typename Counting>
    static void run(const Layout &layout, const Ray &ray, Query &query, Counting counting) {
        traverse<fault, Test>(layout, ray, query, counting);
    }
};

template <typename Walk> class PackedTree final : public Accelerator {
public:
    PackedTree(typename Walk::Layout layout, const TriangleSet &set, Statistics statistics)
        : m_layout(std::move(layout)) {
        m_statistics = std::move(statistics);
        for (const MemoryPart &part : m_layout.memory())
            m_statistics.bytes += part.size;
        m_bounds = set.bounds;
    }

    Hit closest(const Ray &ray) const noexcept override { return run<ClosestQuery>(ray, NoCounters{}); }
    bool any(const Ray &ray) const noexcept override { return run<AnyQuery>(ray, NoCounters{}); }
    Hit count_closest(const Ray &ray, Counters &counters) const noexcept override {
        return run<ClosestQuery>(ray, CountInto{counters});
    }
    bool count_any(const Ray &ray, Counters &counters) const noexcept override {
        return run<AnyQuery>(ray, CountInto{counters});
    }

    std::vector<Plane> planes() const override { return planes_of(m_layout); }
    std::vector<MemoryPart> memory() const override { return m_layout.memory(); }

private:
    template <typename Query, typename Counting> auto run(const Ray &ray, Counting counting) const noexcept {
        Query query(ray.maxt);
        Walk::run(m_layout, ray, query, counting);
        return query.result();
    }

    typename Walk::Layout m_layout;
};

/// Packs the tree as `kind` says and adds the time that takes to `statistics`. Throws std::length_error if the tree is
/// too large for the layout.
template <typename Test, Fault fault>
std::unique_ptr<Accelerator> pack_tree(const Tree &tree, const TriangleSet &set, LayoutKind kind,
                                       Statistics statistics) {
    describe_tree(tree, statistics);
    const auto start = std::chrono::steady_clock::now();
    const auto finish = [&](auto walk, auto layout) -> std::unique_ptr<Accelerator> {
        statistics.phases.pack_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        statistics.build_s += statistics.phases.pack_s;
        return std::make_unique<PackedTree<decltype(walk)>>(std::move(layout), set, std::move(statistics));
    };
    if (kind == LayoutKind::wide)
        return finish(WideWalk<Test, fault>{}, pack_wide(tree, set));
    BinaryLayout layout = pack_binary(tree, set);
    switch (layout.splits) {
    case Splits::axes:
        return finish(BinaryWalk<Test, Splits::axes, fault>{}, std::move(layout));
    case Splits::families:
        return finish(BinaryWalk<Test, Splits::families, fault>{}, std::move(layout));
    case Splits::planes:
        break;
    }
    return finish(BinaryWalk<Test, Splits::planes, fault>{}, std::move(layout));
}

} // namespace bsp
