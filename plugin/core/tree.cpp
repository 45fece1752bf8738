#include "tree.h"

#include <algorithm>

#include "settings.h"

namespace bsp {
namespace {

std::string at(const char *what, std::size_t index) { return std::string(what) + " " + std::to_string(index); }

/// Depth of every node, found along the way: parents come before their children.
std::string check_structure(const Tree &tree) {
    std::vector<int> depth(tree.nodes.size(), -1);
    depth[0] = 0;
    for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
        const TreeNode &node = tree.nodes[i];
        if (depth[i] < 0)
            return at("node", i) + " has no parent";
        if (node.kind == TreeNode::Kind::leaf)
            continue;
        if (!std::isfinite(node.offset))
            return at("node", i) + " has a plane that is not finite";
        if (node.kind == TreeNode::Kind::axis && !node.direction.is_axis())
            return at("node", i) + " is an axis node with an oblique plane";
        if (node.above <= i + 1 || node.above >= tree.nodes.size())
            return at("node", i) + " has a child outside the tree";
        for (const std::size_t child : {i + 1, std::size_t(node.above)}) {
            if (depth[child] >= 0)
                return at("node", child) + " has two parents";
            depth[child] = depth[i] + 1;
        }
    }
    if (*std::max_element(depth.begin(), depth.end()) > depth_limit)
        return "the tree is deeper than " + std::to_string(depth_limit) + " levels";
    return {};
}

} // namespace

std::string validate(const Tree &tree, const TriangleSet &set) {
    if (tree.nodes.empty())
        return "the tree has no root";
    if (std::string broken = check_structure(tree); !broken.empty())
        return broken;

    std::vector<bool> usable(set.triangles.size(), false), listed(set.triangles.size(), false);
    for (const std::uint32_t id : set.valid)
        usable[id] = true;
    for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
        const TreeNode &node = tree.nodes[i];
        if (node.kind != TreeNode::Kind::leaf)
            continue;
        if (std::size_t(node.first) + node.count > tree.references.size())
            return at("leaf", i) + " lists triangles outside the tree";
        for (std::uint32_t r = node.first; r < node.first + node.count; ++r) {
            const std::uint32_t id = tree.references[r];
            if (id >= usable.size() || !usable[id])
                return at("leaf", i) + " lists " + at("triangle", id) + ", which is not a valid one";
            if (r > node.first && tree.references[r - 1] >= id)
                return at("leaf", i) + " lists its triangles out of order";
            listed[id] = true;
        }
    }
    for (const std::uint32_t id : set.valid)
        if (!listed[id])
            return at("triangle", id) + " is in no leaf";
    return {};
}

} // namespace bsp
