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

    /// The node for the subtree of `root`, a leaf included.
    WideChild add_node(std::size_t root) {
        const bool is_oblique = has_oblique(root, wide_levels);
        const std::size_t line = new_node(is_oblique);
        fill(line, is_oblique, 0, 0, WideNode::cells / 2, root);
        return WideChild::node(std::uint32_t(line), is_oblique);
    }

private:
    bool has_oblique(std::size_t from, int depth) const {
        const TreeNode &node = m_tree.nodes[from];
        if (depth == 0 || node.kind == TreeNode::Kind::leaf)
            return false;
        return node.kind == TreeNode::Kind::oblique || has_oblique(from + 1, depth - 1) ||
               has_oblique(node.above, depth - 1);
    }

    /// Puts the subtree of `from` where plane `plane` of a node is, and its cells from `cell` on; `reach` is the bit
    /// that this level decides, 0 below the last.
    void fill(std::size_t line, bool is_oblique, unsigned plane, unsigned cell, unsigned reach, std::size_t from) {
        const TreeNode &node = m_tree.nodes[from];
        if (reach == 0 || node.kind == TreeNode::Kind::leaf) {
            const WideChild child = child_of(from); // may move the nodes
            WideNode &wide = m_layout.lines[line].node;
            wide.children[cell] = child.with_axis(wide.axis(cell));
            return;
        }
        for (unsigned lane = 0; lane < WideNode::cells; ++lane)
            if (WideNode::plane_of_lane[lane] == plane)
                set_plane(line, is_oblique, lane, node);
        fill(line, is_oblique, 2 * plane + 1, cell, reach / 2, from + 1);
        fill(line, is_oblique, 2 * plane + 2, cell + reach, reach / 2, node.above);
    }

    void set_plane(std::size_t line, bool is_oblique, unsigned lane, const TreeNode &node) {
        WideNode &wide = m_layout.lines[line].node;
        wide.offsets[lane] = node.offset;
        wide.children[lane] = WideChild(wide.children[lane]).with_axis(node.direction.major);
        if (is_oblique) {
            m_layout.lines[line + 1].slopes.a[lane] = node.direction.a;
            m_layout.lines[line + 1].slopes.b[lane] = node.direction.b;
        }
    }

    WideChild child_of(std::size_t from) {
        const TreeNode &node = m_tree.nodes[from];
        if (node.kind != TreeNode::Kind::leaf)
            return add_node(from);
        if (node.count == 0)
            return WideChild{};
        const std::size_t first = m_layout.blocks.size();
        add_blocks(m_tree.references.data() + node.first, node.count, m_set, m_layout.blocks);
        return leaf_child(first, m_layout.blocks.size() - first);
    }

    /// A leaf, or a node without planes whose cells share its blocks if there are too many for one.
    WideChild leaf_child(std::size_t first, std::size_t count) {
        if (count <= WideChild::max_blocks) {
            check_index(first);
            return WideChild::leaf(std::uint32_t(first), std::uint32_t(count));
        }
        const std::size_t line = new_node(false);
        std::fill_n(m_layout.lines[line].node.offsets, WideNode::cells, std::numeric_limits<float>::quiet_NaN());
        for (std::size_t cell = 0; cell < WideNode::cells; ++cell) {
            const std::size_t begin = count * cell / WideNode::cells, end = count * (cell + 1) / WideNode::cells;
            if (begin == end)
                continue;
            const WideChild child = leaf_child(first + begin, end - begin);
            m_layout.lines[line].node.children[cell] = child.with_axis(0);
        }
        return WideChild::node(std::uint32_t(line), false);
    }

    /// The line of a node without planes and children, and with the line of its slopes if there are to be some.
    std::size_t new_node(bool is_oblique) {
        const std::size_t line = m_layout.lines.size();
        check_index(line + 1);
        WideLine node{};
        std::fill(std::begin(node.node.offsets), std::end(node.node.offsets), std::numeric_limits<float>::infinity());
        m_layout.lines.push_back(node);
        if (is_oblique)
            m_layout.lines.push_back({});
        return line;
    }

    static void check_index(std::size_t index) {
        if (index > WideChild::max_index)
            throw std::length_error("the tree is too large for its node format: " + std::to_string(index) +
                                    " nodes or blocks are above 2^26; raise leaf_size or lower max_references");
    }

    const Tree &m_tree;
    const TriangleSet &m_set;
    WideLayout &m_layout;
};

} // namespace

WideLayout pack_wide(const Tree &tree, const TriangleSet &set) {
    WideLayout layout;
    layout.orientation = tree.orientation;
    const Box box = packed_box(tree);
    layout.box = {{box.lower.x, box.lower.y, box.lower.z, 0}, {box.upper.x, box.upper.y, box.upper.z, 0}};
    layout.plane_tolerance = packed_tolerance(tree);
    std::size_t blocks = 0;
    for (const TreeNode &node : tree.nodes)
        blocks += (node.count + TriangleBlock::width - 1) / TriangleBlock::width;
    layout.blocks.reserve(blocks);
    layout.root = WidePacker(tree, set, layout).add_node(0);
    return layout;
}

std::vector<Plane> planes_of(const WideLayout &layout) {
    std::vector<Plane> planes;
    const auto visit = [&](const auto &self, WideChild node) -> void {
        const WideLine *const line = layout.lines.data() + node.index();
        for (const unsigned lane : WideNode::lane_of_plane) {
            if (!std::isfinite(line->node.offsets[lane]))
                continue;
            Direction direction{std::uint8_t(line->node.axis(lane)), 0, 0};
            if (node.is_oblique()) {
                direction.a = line[1].slopes.a[lane];
                direction.b = line[1].slopes.b[lane];
            }
            const Vec3d n = direction.normal();
            planes.push_back({{float(n.x), float(n.y), float(n.z)}, line->node.offsets[lane]});
        }
        for (unsigned cell = 0; cell < WideNode::cells; ++cell)
            if (const WideChild child = WideChild(line->node.children[cell]); !child.is_empty() && !child.is_leaf())
                self(self, child);
    };
    visit(visit, layout.root);
    return planes;
}

} // namespace bsp
