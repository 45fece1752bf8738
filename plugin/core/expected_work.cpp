#include "expected_work.h"

#include "cell.h"
#include "settings.h"

namespace bsp {
namespace {

class Walk {
public:
    Walk(const Tree &tree, const Cell &root) : m_tree(tree), m_area(root.area()) {}

    /// Counts the subtree; whether it begins with an oblique plane, or has one further down in the same wide node.
    bool visit(std::uint32_t index, const Cell &cell, int depth) {
        const TreeNode &node = m_tree.nodes[index];
        const double share = m_area > 0 ? cell.area() / m_area : 1;
        if (node.kind == TreeNode::Kind::leaf) {
            work.leaves += node.count > 0 ? share : 0;
            work.tests += share * node.count;
            return false;
        }
        bool is_oblique = node.kind == TreeNode::Kind::oblique;
        if (const auto cells = cell.split(node.direction, node.offset)) {
            const bool below = visit(index + 1, cells->first, depth + 1);
            const bool above = visit(node.above, cells->second, depth + 1);
            if ((depth + 1) % wide_levels != 0)
                is_oblique = is_oblique || below || above;
        }
        if (depth % wide_levels == 0)
            (is_oblique ? work.oblique_nodes : work.axis_nodes) += share;
        return is_oblique;
    }

    Work work;

private:
    const Tree &m_tree;
    const double m_area;
};

} // namespace

Work expected_work(const Tree &tree) {
    const Cell root(tree.box);
    Walk walk(tree, root);
    walk.visit(0, root, 0);
    return walk.work;
}

} // namespace bsp
