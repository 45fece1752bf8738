/// The neutral result of building: a binary tree of planes over lists of triangles, before it is packed for traversal.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "direction.h"
#include "orientation.h"
#include "triangles.h"

namespace bsp {

/// A plane with two children (the one below follows the node, the one above is at `above`), or a leaf.
struct TreeNode {
    enum class Kind : std::uint8_t { leaf, axis, oblique } kind = Kind::leaf;
    Direction direction;
    float offset = 0;
    std::uint32_t above = 0;            ///< interior: index of the child above
    std::uint32_t first = 0, count = 0; ///< leaf: its part of `Tree::references`
};

/// What was looked at and made at one depth; the root's is 0.
struct LevelCounts {
    std::size_t axis_nodes = 0, oblique_nodes = 0, leaves = 0, references = 0;
    std::size_t planes = 0; ///< whose price was computed, in nodes that became leaves too
};

/// Where the time of building went, in seconds, summed over the threads that build nodes.
struct BuildPhases {
    double directions_s = 0, estimates_s = 0, sweeps_s = 0, partition_s = 0, pack_s = 0;
};

struct Tree {
    Orientation orientation;               ///< the axes that `box` and all planes are seen in
    Bounds box;                            ///< the root's cell
    std::vector<TreeNode> nodes;           ///< depth first; the root is nodes[0]
    std::vector<std::uint32_t> references; ///< triangle ids of the leaves, ascending within a leaf
    double sah_cost = 0;                   ///< expected price of a random ray that meets the root's cell
    int depth = 0;                         ///< interior nodes on the longest path
    double plane_tolerance = 0;            ///< triangles may protrude from their cells by this, beyond oblique planes
    std::size_t capped_leaves = 0;         ///< leaves that a cap on references or depth kept from being split
    std::size_t capped_references = 0;     ///< those of these leaves
    std::vector<LevelCounts> levels;
    BuildPhases phases;
};

/// Fills in `depth` and the nodes of `levels`; the tree must be valid.
void describe_levels(Tree &tree);

/// The first law of trees that `tree` breaks, in one sentence, or an empty string: depth-first structure,
/// planes, depth, ids, and every valid triangle in at least one leaf. A tree that breaks none is safe to pack and
/// traverse, wherever it comes from.
std::string validate(const Tree &tree, const TriangleSet &set);

} // namespace bsp
