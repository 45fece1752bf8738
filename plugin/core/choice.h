/// The tree `auto`: which tree pays for these triangles and so many rays, decided from counts, never from a clock.
#pragma once

#include <string>

#include "build_monitor.h"
#include "settings.h"
#include "triangles.h"

namespace bsp {

struct Choice {
    Settings settings;               ///< of the tree to build
    std::string reason;              ///< one sentence: what was seen and what is predicted
    double build_s = 0, trace_s = 0; ///< predicted, of one thread: to build it, and to trace the expected rays
};

/// `settings` themselves, without a reason, unless their tree is `auto`. Then looks at the normals, weighted by area,
/// and at how tightly triangles fill their boxes (scene_shape.h), and, unless nearly all lie along the axes or boxes
/// are tight, builds small parts of the scene twice, as `kd` and as `normals`. Takes the tree with the least predicted
/// time to build and to trace `settings.expected_rays`. The same for the same triangles and settings. Throws as
/// `build_tree`.
Choice choose_tree(const TriangleSet &set, const Settings &settings, BuildMonitor *monitor = nullptr);

} // namespace bsp
