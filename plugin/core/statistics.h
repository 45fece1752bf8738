/// What a tree is made of and what its building took, for people and records.
#pragma once

#include <string>
#include <vector>

#include "tree.h"

namespace bsp {

/// Zero for brute force where it does not apply.
struct Statistics {
    std::string spec;
    std::string chosen;    ///< of `auto`: the spec of the tree it built; else empty
    std::string choice;    ///< of `auto`: why that one, in one sentence
    std::string precision; ///< what it is, and why, where it is not what was asked for; else empty
    double choose_s = 0;   ///< of `auto`: part of `build_s`
    double predicted_build_s = 0, predicted_trace_s = 0; ///< of `auto`: on one thread
    std::size_t triangles = 0, dropped_triangles = 0, primitives = 0;
    std::size_t nodes = 0, interior_nodes = 0, axis_nodes = 0, oblique_nodes = 0;
    std::size_t leaves = 0, empty_leaves = 0, references = 0;
    std::size_t capped_leaves = 0;     ///< leaves that would have been split, but for `max_references` or `max_depth`
    std::size_t capped_references = 0; ///< those of these leaves
    int max_depth = 0;
    std::size_t bytes = 0;
    double sah_cost = 0;
    double build_s = 0;              ///< of building and packing; if `loaded`, of loading and packing
    bool loaded = false;             ///< the tree was not built but found in the folder of saved trees
    std::string warning;             ///< what users should know, in one sentence each; the tree is right all the same
    std::vector<LevelCounts> levels; ///< from the root down
    std::vector<std::size_t> leaf_sizes; ///< leaves by their number of triangles; the last entry: that many or more
    BuildPhases phases;
};

/// Fills in what the tree tells about itself.
void describe_tree(const Tree &tree, Statistics &statistics);

/// One JSON object, on one line.
std::string to_json(const Statistics &statistics);

} // namespace bsp
