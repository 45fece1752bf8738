#include "direction.h"

#include <cmath>

namespace bsp {

Vec3d Direction::normal() const {
    Vec3d n;
    n[major] = 1;
    n[next_axis[major]] = a;
    n[after_axis[major]] = b;
    return n;
}

Direction make_direction(const Vec3d &vector) {
    std::uint8_t major = 0;
    for (std::uint8_t axis = 1; axis < 3; ++axis)
        if (std::abs(vector[axis]) > std::abs(vector[major]))
            major = axis;
    if (vector[major] == 0)
        return {major, 0, 0};
    const double scale = 1 / vector[major];
    const double a = vector[next_axis[major]] * scale, b = vector[after_axis[major]] * scale;
    if (a * a + b * b < snap_angle * snap_angle)
        return {major, 0, 0};
    // Adding +0 turns -0 into +0, so that equal directions have equal bits.
    return {major, float(a) + 0.0f, float(b) + 0.0f};
}

bool nearly_parallel(const Direction &x, const Direction &y, double angle) {
    const Vec3d u = x.normal(), v = y.normal();
    return norm(cross(u, v)) < angle * norm(u) * norm(v);
}

} // namespace bsp
