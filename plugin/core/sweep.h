/// The sweep: the cheapest plane of one direction by the surface area heuristic (MacDonald, Booth 1990), over the 2n
/// end points of the clipped triangles (Havran 2000, section 4.2).
#pragma once

#include <optional>
#include <vector>

#include "cell.h"
#include "references.h"
#include "settings.h"

namespace bsp {

/// The plane of least `cost` that cuts the cell; ties go to the smaller offset. Nothing if no end point lies inside.
/// The offsets that were priced are appended to `offsets`, if it is given.
std::optional<SweptPlane> sweep(const ReferenceList &references, const Cell &cell, const Direction &direction,
                                const CostModel &cost, std::vector<float> *offsets = nullptr);

/// An estimate of what `sweep` would find, in O(n): the cheapest of 63 planes at equal distances. Its offset is not
/// that of an end point; nothing if the direction has no extent. Meant to compare directions, not to cut along.
std::optional<SweptPlane> estimate(const ReferenceList &references, const Cell &cell, const Direction &direction,
                                   const CostModel &cost);

} // namespace bsp
