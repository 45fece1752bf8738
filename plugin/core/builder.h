/// The one builder of all trees: asks the source for directions, sweeps them, splits, stops.
#pragma once

#include "settings.h"
#include "tree.h"
#include "triangles.h"

namespace bsp {

/// Builds on all threads of the pool. The tree depends on the triangles and the settings only, bit for bit, not on the
/// number of threads. A set without valid triangles gives one empty leaf. Throws std::bad_alloc if memory runs out.
Tree build_tree(const TriangleSet &set, const Settings &settings);

/// The box every tree starts from: that of the triangles, slightly larger so that planes through its faces cut it.
Bounds root_box(const TriangleSet &set);

} // namespace bsp
