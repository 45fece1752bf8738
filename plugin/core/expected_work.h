/// What a random ray is expected to meet in a tree, in counts: the surface area heuristic without its prices.
#pragma once

#include "tree.h"

namespace bsp {

/// Of a ray that meets the root's cell, where no hit ends it.
struct Work {
    double axis_nodes = 0, oblique_nodes = 0; ///< wide nodes; oblique: of whose planes at least one is
    double leaves = 0, tests = 0;             ///< leaves that are not empty, and their triangles

    void add(const Work &more) {
        axis_nodes += more.axis_nodes;
        oblique_nodes += more.oblique_nodes;
        leaves += more.leaves;
        tests += more.tests;
    }
};

Work expected_work(const Tree &tree);

} // namespace bsp
