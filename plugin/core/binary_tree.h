/// An accelerator made of a tree in the binary layout.
#pragma once

#include <memory>

#include "accelerator.h"
#include "traversal.h"

namespace bsp {

/// A tree in the binary layout.
template <typename Test, Splits splits, Fault fault> class BinaryTree final : public Accelerator {
public:
    BinaryTree(BinaryLayout layout, const TriangleSet &set, Statistics statistics) : m_layout(std::move(layout)) {
        m_statistics = std::move(statistics);
        m_statistics.bytes = m_layout.bytes();
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
    std::vector<MemoryPart> memory() const override {
        return {{m_layout.words.data(), m_layout.words.size() * sizeof(NodeWord)},
                {m_layout.blocks.data(), m_layout.blocks.size() * sizeof(TriangleBlock)}};
    }

private:
    template <typename Query, typename Counting> auto run(const Ray &ray, Counting counting) const noexcept {
        Query query(ray.maxt);
        traverse<splits, fault, Test>(m_layout, ray, query, counting);
        return query.result();
    }

    BinaryLayout m_layout;
};

template <typename Test, Fault fault>
std::unique_ptr<Accelerator> make_binary_tree(BinaryLayout layout, const Tree &tree, const TriangleSet &set,
                                              Statistics statistics) {
    describe_tree(tree, statistics);
    switch (layout.splits) {
    case Splits::axes:
        return std::make_unique<BinaryTree<Test, Splits::axes, fault>>(std::move(layout), set, std::move(statistics));
    case Splits::families:
        return std::make_unique<BinaryTree<Test, Splits::families, fault>>(std::move(layout), set,
                                                                           std::move(statistics));
    case Splits::planes:
        break;
    }
    return std::make_unique<BinaryTree<Test, Splits::planes, fault>>(std::move(layout), set, std::move(statistics));
}

} // namespace bsp
