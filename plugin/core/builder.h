/// The one builder of all trees: asks the source for directions, sweeps them, splits, stops.
#pragma once

#include "build_monitor.h"
#include "settings.h"
#include "tree.h"
#include "triangles.h"

namespace bsp {

/// Builds on all threads of the pool. The tree depends on the triangles and the settings only, bit for bit, not on the
/// number of threads. A set without valid triangles gives one empty leaf. Throws std::bad_alloc if memory runs out and
/// BuildCancelled if the monitor says so.
Tree build_tree(const TriangleSet &set, const Settings &settings, BuildMonitor *monitor = nullptr);

/// What figure 2.1 of Hoobergs's draft asks of one depth: how many planes were looked at, and how many of them differ.
struct LevelPlanes {
    std::size_t considered = 0, different = 0;
};

/// Builds a tree and counts the planes of its exact sweeps per depth; the last entry is for the whole tree. Needs 8
/// bytes per different plane. Throws as `build_tree`.
std::vector<LevelPlanes> survey_planes(const TriangleSet &set, const Settings &settings,
                                       BuildMonitor *monitor = nullptr);

/// Levels of interior nodes that a tree of so many valid triangles may have.
int depth_allowed(const Settings &settings, std::size_t triangles);

/// The box a tree starts from: that of the triangles, slightly larger so that planes through its faces cut it.
Bounds root_box(const TriangleSet &set);

} // namespace bsp
