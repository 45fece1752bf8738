#include "binary_tree.h"

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
    s.max_depth = tree.depth;
    s.sah_cost = tree.sah_cost;
}

} // namespace bsp
