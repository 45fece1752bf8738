#include "tree.h"

#include <algorithm>

#include "settings.h"

namespace bsp {
namespace {

std::string at(const char *what, std::size_t index) { return std::string(what) + " " + std::to_string(index); }

/// What is wrong with an interior node by itself, or an empty string.
std::string check_plane(const TreeNode &node) {
    const Direction &direction = node.direction;
    if (node.kind != TreeNode::Kind::axis && node.kind != TreeNode::Kind::oblique)
        return " is of no known kind";
    if (direction.major > 2 || !(std::abs(direction.a) <= 1) || !(std::abs(direction.b) <= 1))
        return " has a plane without a direction";
    if (!std::isfinite(node.offset))
        return " has a plane that is not finite";
    if (node.kind == TreeNode::Kind::axis && !direction.is_axis())
        return " is an axis node with an oblique plane";
    return {};
}

/// Walks the nodes in their order, which must be depth first.
std::string check_structure(const Tree &tree) {
    struct Open {
        std::size_t node;
        int depth;
    };
    std::vector<Open> open; // interior nodes whose child above is still to come
    int depth = 0;
    std::size_t listed = 0;
    for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
        const TreeNode &node = tree.nodes[i];
        if (node.kind != TreeNode::Kind::leaf) {
            if (const std::string broken = check_plane(node); !broken.empty())
                return at("node", i) + broken;
            if (node.above <= i + 1 || node.above >= tree.nodes.size())
                return at("node", i) + " has a child outside the tree";
            open.push_back({i, depth});
            if (++depth > depth_limit)
                return "the tree is deeper than " + std::to_string(depth_limit) + " levels";
            continue;
        }
        if (node.first != listed)
            return at("leaf", i) + " does not list its triangles behind those of the leaf before";
        listed += node.count;
        if (i + 1 == tree.nodes.size())
            break;
        if (open.empty())
            return at("node", i + 1) + " has no parent";
        if (tree.nodes[open.back().node].above != i + 1)
            return at("node", open.back().node) + " has a child out of depth-first order";
        depth = open.back().depth + 1;
        open.pop_back();
    }
    if (!open.empty())
        return at("node", open.back().node) + " has only one child";
    if (listed != tree.references.size())
        return "the leaves list " + std::to_string(listed) + " triangles, but the tree has " +
               std::to_string(tree.references.size());
    return {};
}

} // namespace

void describe_levels(Tree &tree) {
    std::vector<std::size_t> depth(tree.nodes.size(), 0);
    for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
        const TreeNode &node = tree.nodes[i];
        tree.levels.resize(std::max(tree.levels.size(), depth[i] + 1));
        LevelCounts &level = tree.levels[depth[i]];
        level.axis_nodes += node.kind == TreeNode::Kind::axis;
        level.oblique_nodes += node.kind == TreeNode::Kind::oblique;
        level.leaves += node.kind == TreeNode::Kind::leaf;
        level.references += node.count;
        if (node.kind == TreeNode::Kind::leaf)
            continue;
        depth[i + 1] = depth[node.above] = depth[i] + 1;
        tree.depth = std::max(tree.depth, int(depth[i]) + 1);
    }
}

std::string validate(const Tree &tree, const TriangleSet &set) {
    if (tree.nodes.empty())
        return "the tree has no root";
    if (std::string broken = check_structure(tree); !broken.empty())
        return broken;

    std::vector<bool> usable(set.triangles.size(), false), listed(set.triangles.size(), false);
    std::vector<bool> listed_primitives(set.primitives.size(), false);
    for (const std::uint32_t id : set.valid)
        usable[id] = true;
    for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
        const TreeNode &node = tree.nodes[i];
        if (node.kind != TreeNode::Kind::leaf)
            continue;
        for (std::size_t r = node.first; r < std::size_t(node.first) + node.count; ++r) {
            const std::uint32_t id = tree.references[r];
            const bool known =
                is_primitive(id) ? primitive_index(id) < listed_primitives.size() : id < usable.size() && usable[id];
            if (!known)
                return at("leaf", i) + " lists " + at("triangle", id) + ", which is not a valid one";
            if (r > node.first && tree.references[r - 1] >= id)
                return at("leaf", i) + " lists its triangles out of order";
            if (is_primitive(id))
                listed_primitives[primitive_index(id)] = true;
            else
                listed[id] = true;
        }
    }
    for (const std::uint32_t id : set.valid)
        if (!listed[id])
            return at("triangle", id) + " is in no leaf";
    const auto lost = std::find(listed_primitives.begin(), listed_primitives.end(), false);
    if (lost != listed_primitives.end())
        return at("primitive", std::size_t(lost - listed_primitives.begin())) + " is in no leaf";
    return {};
}

} // namespace bsp
