#include "binary_tree.h"

#include <algorithm>

namespace bsp {

void describe_tree(const Tree &tree, Statistics &s) {
    s.nodes = tree.nodes.size();
    for (const TreeNode &node : tree.nodes) {
        s.axis_nodes += node.kind == TreeNode::Kind::axis;
        s.oblique_nodes += node.kind == TreeNode::Kind::oblique;
        s.leaves += node.kind == TreeNode::Kind::leaf;
        s.empty_leaves += node.kind == TreeNode::Kind::leaf && node.count == 0;
    }
    s.interior_nodes = s.nodes - s.leaves;
    s.references = tree.references.size();
    s.capped_leaves = tree.capped_leaves;
    s.levels = tree.levels;
    s.phases = tree.phases;
    constexpr std::size_t largest_size_listed = 32;
    s.leaf_sizes.assign(largest_size_listed + 1, 0);
    for (const TreeNode &node : tree.nodes)
        if (node.kind == TreeNode::Kind::leaf)
            ++s.leaf_sizes[std::min<std::size_t>(node.count, largest_size_listed)];
    s.max_depth = tree.depth;
    s.sah_cost = tree.sah_cost;
}

} // namespace bsp
