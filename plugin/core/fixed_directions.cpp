#include "fixed_directions.h"

#include <cmath>

namespace bsp {

std::vector<Direction> fixed_directions(DirectionSet set, int k) {
    std::vector<Direction> directions{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
    const int others = k - 3;
    if (set == DirectionSet::spiral) {
        const double golden_angle = M_PI * (3 - std::sqrt(5.0));
        for (int i = 0; i < others; ++i) {
            const double z = (i + 0.5) / others, r = std::sqrt(1 - z * z);
            directions.push_back(make_direction({r * std::cos(golden_angle * i), r * std::sin(golden_angle * i), z}));
        }
        return directions;
    }
    if (k == 7 || k == 13)
        for (const double y : {1.0, -1.0})
            for (const double z : {1.0, -1.0})
                directions.push_back(make_direction({1, y, z}));
    if (k == 9 || k == 13)
        for (const double s : {1.0, -1.0})
            for (const Vec3d &diagonal : {Vec3d{1, s, 0}, Vec3d{0, 1, s}, Vec3d{s, 0, 1}})
                directions.push_back(make_direction(diagonal));
    return directions;
}

} // namespace bsp
