/// The split directions of `rbsp`: one set for the whole tree.
#pragma once

#include <vector>

#include "direction.h"
#include "settings.h"

namespace bsp {

/// The k directions of a set, the three axes first. `kdop` has them for k = 3, 7 (the axes and the cube's diagonals), 9
/// (the axes and the diagonals of its faces) and 13 (all): Klosowski et al. 1998; Budge et al. 2008. `spiral` has the
/// axes and k - 3 points of a golden-ratio spiral over the hemisphere, for any k from 3 up: Kammaje, Mora 2007.
std::vector<Direction> fixed_directions(DirectionSet set, int k);

} // namespace bsp
