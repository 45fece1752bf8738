/// A split direction as it is swept, stored and traversed: a normal whose largest component is exactly 1.
#pragma once

#include <array>
#include <cstdint>

#include "vec.h"

namespace bsp {

/// The plane family p[major] + a p[next] + b p[after] = offset, with |a|, |b| <= 1 and next, after the axes that follow
/// `major` cyclically. A direction and its opposite are the same family. Two floats describe it exactly, so building
/// and traversal work with the same normal, bit for bit.
struct Direction {
    std::uint8_t major = 0;
    float a = 0, b = 0;

    bool is_axis() const { return a == 0 && b == 0; }
    Vec3d normal() const;
    bool operator==(const Direction &o) const { return major == o.major && a == o.a && b == o.b; }
};

constexpr std::array<std::uint8_t, 3> next_axis{1, 2, 0};
constexpr std::array<std::uint8_t, 3> after_axis{2, 0, 1};

/// The position of `p` along the direction: the value compared with plane offsets, always computed in this order.
inline double position(const Direction &direction, const Vec3d &p) {
    return p[direction.major] + double(direction.a) * p[next_axis[direction.major]] +
           double(direction.b) * p[after_axis[direction.major]];
}

/// The direction of a vector of any length; some axis for zero. Vectors within `snap_angle` of an axis become that
/// axis.
Direction make_direction(const Vec3d &vector);

/// Radians: what is nearer to an axis than this is that axis.
constexpr double snap_angle = 1e-4;

/// Whether the angle between the two, signs aside, is below `angle` (radians, small).
bool nearly_parallel(const Direction &x, const Direction &y, double angle);

} // namespace bsp
