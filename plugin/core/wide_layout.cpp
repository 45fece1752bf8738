#include "wide_layout.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace bsp {
namespace {

/// Builds the nodes depth first, so that a node's first child follows it.
class WidePacker {
public:
    WidePacker(const Tree &tree, const TriangleSet &set, WideLayout &layout)
        : m_tree(tree), m_set(set), m_layout(layout) {}

    /// The node for the subtree of `root`, a leaf included; returns its index.
    std::uint32_t add_node(std::size_t root) {
        const std::uint32_t index = new_node();
        fill(index, 0, 0, 4, root);
        return index;
    }

private:
    /// Puts the subtree of `from` where plane `plane` of a node is, and its cells from `cell` on; `reach` is the bit
    /// that this level decides, 0 below the last.
    void fill(std::uint32_t index, unsigned plane, unsigned cell, unsigned reach, std::size_t from) {
        const TreeNode &node = m_tree.nodes[from];
        if (reach == 0 || node.kind == TreeNode::Kind::leaf) {
            const WideChild child = child_of(from); // may move the nodes
            m_layout.nodes[index].children[cell] = child;
            return;
        }
        WideNode &wide = m_layout.nodes[index];
        const Vec3d normal = node.direction.normal();
        for (unsigned axis = 0; axis < 3; ++axis)
            wide.normals[axis][plane] = float(normal[axis]);
        wide.offsets[plane] = node.offset;
        m_layout.has_oblique |= !node.direction.is_axis();
        fill(index, 2 * plane + 1, cell, reach / 2, from + 1);
        fill(index, 2 * plane + 2, cell + reach, reach / 2, node.above);
    }

    WideChild child_of(std::size_t from) {
        const TreeNode &node = m_tree.nodes[from];
        if (node.kind != TreeNode::Kind::leaf)
            return WideChild::node(add_node(from));
        if (node.count == 0)
            return WideChild{};
        const std::size_t first = m_layout.blocks.size();
        add_blocks(m_tree.references.data() + node.first, node.count, m_set, m_layout.blocks);
        return leaf_child(first, m_layout.blocks.size() - first);
    }

    /// A leaf, or a node without planes whose cells share its blocks if there are too many for one.
    WideChild leaf_child(std::size_t first, std::size_t count) {
        if (first + count > WideChild::max_first)
            throw std::length_error("the tree is too large for its node format: " + std::to_string(first + count) +
                                    " blocks are above 2^26; raise leaf_size or lower max_references");
        if (count <= WideChild::max_blocks)
            return WideChild::leaf(std::uint32_t(first), std::uint32_t(count));
        const std::uint32_t index = new_node();
        std::fill_n(m_layout.nodes[index].offsets, WideNode::planes, std::numeric_limits<float>::quiet_NaN());
        for (std::size_t cell = 0; cell < WideNode::cells; ++cell) {
            const std::size_t begin = count * cell / WideNode::cells, end = count * (cell + 1) / WideNode::cells;
            if (begin == end)
                continue;
            const WideChild child = leaf_child(first + begin, end - begin);
            m_layout.nodes[index].children[cell] = child;
        }
        return WideChild::node(index);
    }

    std::uint32_t new_node() {
        WideNode node{};
        std::fill(std::begin(node.offsets), std::end(node.offsets), std::numeric_limits<float>::infinity());
        m_layout.nodes.push_back(node);
        return std::uint32_t(m_layout.nodes.size() - 1);
    }

    const Tree &m_tree;
    const TriangleSet &m_set;
    WideLayout &m_layout;
};

} // namespace

WideLayout pack_wide(const Tree &tree, const TriangleSet &set) {
    WideLayout layout;
    layout.box = packed_box(set);
    layout.plane_tolerance = packed_tolerance(tree);
    std::size_t blocks = 0;
    for (const TreeNode &node : tree.nodes)
        blocks += (node.count + TriangleBlock::width - 1) / TriangleBlock::width;
    layout.blocks.reserve(blocks);
    layout.nodes.reserve(tree.nodes.size() / 8 + 1);
    WidePacker(tree, set, layout).add_node(0);
    return layout;
}

std::vector<Plane> planes_of(const WideLayout &layout) {
    std::vector<Plane> planes;
    for (const WideNode &node : layout.nodes)
        for (unsigned plane = 0; plane < WideNode::planes; ++plane)
            if (std::isfinite(node.offsets[plane]))
                planes.push_back(
                    {{node.normals[0][plane], node.normals[1][plane], node.normals[2][plane]}, node.offsets[plane]});
    return planes;
}

} // namespace bsp
