/// What a scene's triangles tell about the tree that suits them: along which directions they face, and how much of
/// their boxes they fill. From a sample spread evenly over their area, or from all of them where they are few.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "orientation.h"
#include "triangles.h"

namespace bsp {

/// A triangle that stands for `area`, which is twice its own and that of others near it in the list of triangles.
struct SampledTriangle {
    std::uint32_t id = 0;
    double area = 0;
};

/// In the order of their ids.
std::vector<SampledTriangle> sample_by_area(const TriangleSet &set);

/// Triangles that face nearly alike, or opposite ways.
struct Facing {
    double area = 0;           ///< twice that of all of them, as far as the sample tells
    double largest_area = 0;   ///< twice that of the largest in the sample alone
    std::uint32_t largest = 0; ///< which that is
    Vec3d normal;              ///< its, of length 1
};

/// Those that there are, by area, largest first.
std::vector<Facing> facings_of(const TriangleSet &set, const std::vector<SampledTriangle> &sample);

/// How many directions hold the area: n if it is spread evenly over n of them (the inverse of Simpson's index). 3 in
/// a box, a thousand on a scan; 0 without area.
double direction_count(const std::vector<Facing> &facings);

/// How large triangles' boxes are next to them, as rays from everywhere see both: 2 if each is half of a face of its
/// box, about 4 on a scan, 10 and more if large faces lie askew or triangles are long and thin. The boxes are along
/// these axes. 0 without area.
double box_share(const TriangleSet &set, const std::vector<SampledTriangle> &sample,
                 const Orientation &orientation = {});

} // namespace bsp
