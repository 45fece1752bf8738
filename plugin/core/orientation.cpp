#include "orientation.h"

#include <algorithm>
#include <cmath>

#include "accelerator.h"
#include "direction.h"
#include "scene_shape.h"
#include "standard_floats.h"

namespace bsp {
namespace {

constexpr std::size_t tried = 4;                  ///< directions for the first axis, and for the second
constexpr double perpendicular_cosine = 0.014142; ///< of what is perpendicular: as far off as `axis_cosine`

using Axes = std::array<Vec3d, 3>;

constexpr Axes users_axes{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

/// Times the vector's length.
double largest_cosine(const Axes &axes, const Vec3d &v) {
    return std::max({std::abs(dot(axes[0], v)), std::abs(dot(axes[1], v)), std::abs(dot(axes[2], v))});
}

double area_along(const Axes &axes, const std::vector<Facing> &facings) {
    double area = 0;
    for (const Facing &facing : facings)
        area += largest_cosine(axes, facing.normal) >= axis_cosine ? facing.area : 0;
    return area;
}

/// `first`, of length 1, and what is perpendicular to it of `second`, which is not along it.
Axes axes_from(const Vec3d &first, const Vec3d &second) {
    const Vec3d across = second - first * dot(first, second);
    const Vec3d unit = across * (1 / norm(across));
    return {first, unit, cross(first, unit)};
}

Vec3d longest_edge(const Triangle &t) {
    const Vec3d a = to_double(t.a), b = to_double(t.b), c = to_double(t.c);
    return std::max({b - a, c - b, a - c}, [](const Vec3d &x, const Vec3d &y) { return dot(x, x) < dot(y, y); });
}

bool are_users(const Axes &axes) {
    return std::all_of(axes.begin(), axes.end(), [](const Vec3d &axis) { return make_direction(axis).is_axis(); });
}

} // namespace

Orientation::Orientation(const Axes &axes, const Vec3d &origin) : m_turns(true) {
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t k = 0; k < 3; ++k)
            m_columns[k][i] = axes[i][k];
        m_origin[i] = origin[i];
    }
}

Axes Orientation::axes() const {
    Axes rows;
    for (std::size_t i = 0; i < 3; ++i)
        rows[i] = {m_columns[0][i], m_columns[1][i], m_columns[2][i]};
    return rows;
}

Vec3d Orientation::seen(const Vec3d &point) const {
    const Vec3d from = point - origin();
    const Axes rows = axes();
    return {dot(rows[0], from), dot(rows[1], from), dot(rows[2], from)};
}

TriangleSet Orientation::seen(const TriangleSet &set) const {
    const auto rounded = [&](const Vec3f &v) {
        const Vec3d p = seen(to_double(v));
        return Vec3f{float(p.x), float(p.y), float(p.z)};
    };
    TriangleSet turned;
    turned.valid = set.valid;
    turned.triangles.resize(set.triangles.size());
    for (const std::uint32_t id : set.valid) {
        const Triangle &t = set.triangles[id];
        const Triangle own{rounded(t.a), rounded(t.b), rounded(t.c)};
        turned.triangles[id] = own;
        for (const Vec3f &v : {own.a, own.b, own.c})
            turned.bounds.extend(to_double(v));
    }
    for (const Bounds &box : set.primitives)
        turned.add_primitive(seen(box));
    return turned;
}

Bounds Orientation::seen(const Bounds &box) const {
    Bounds around;
    for (unsigned corner = 0; corner < 8; ++corner)
        around.extend(seen(box.corner(corner)));
    return around;
}

Plane Orientation::unseen(const Plane &plane) const {
    const Axes rows = axes();
    const Vec3d normal =
        rows[0] * double(plane.normal.x) + rows[1] * double(plane.normal.y) + rows[2] * double(plane.normal.z);
    const double offset = double(plane.offset) + dot(normal, origin());
    const double scale = 1 / std::max({std::abs(normal.x), std::abs(normal.y), std::abs(normal.z)});
    return {{float(normal.x * scale), float(normal.y * scale), float(normal.z * scale)}, float(offset * scale)};
}

Orientation find_orientation(const TriangleSet &set) {
    const StandardFloats floats;
    return find_orientation(set, facings_of(set, sample_by_area(set)), 0);
}

Orientation find_orientation(const TriangleSet &set, const std::vector<Facing> &facings, double least_share) {
    Axes best = users_axes;
    double best_area = area_along(users_axes, facings);
    const auto offer = [&](const Axes &axes) {
        if (const double area = area_along(axes, facings); area > best_area) {
            best_area = area;
            best = axes;
        }
    };
    for (std::size_t i = 0; i < std::min(tried, facings.size()); ++i) {
        const Facing &first = facings[i];
        std::size_t found = 0;
        for (const Facing &second : facings)
            if (found < tried && std::abs(dot(first.normal, second.normal)) < perpendicular_cosine) {
                offer(axes_from(first.normal, second.normal));
                ++found;
            }
        if (found == 0)
            offer(axes_from(first.normal, longest_edge(set.triangles[first.largest])));
    }
    double area = 0;
    for (const Facing &facing : facings)
        area += facing.area;
    if (are_users(best) || best_area < least_share * area)
        return {};
    const Orientation turned(best, {0, 0, 0});
    Bounds all;
    for (const std::uint32_t id : set.valid)
        for (const Vec3f &v : {set.triangles[id].a, set.triangles[id].b, set.triangles[id].c})
            all.extend(turned.seen(to_double(v)));
    for (const Bounds &box : set.primitives) {
        const Bounds around = turned.seen(box);
        all.extend(around.lower);
        all.extend(around.upper);
    }
    const Vec3d middle = (all.lower + all.upper) * 0.5;
    return {best, best[0] * middle.x + best[1] * middle.y + best[2] * middle.z};
}

double axis_share(const TriangleSet &set, const Orientation &orientation) {
    const Axes axes = orientation.axes();
    double total = 0, aligned = 0;
    for (const std::uint32_t id : set.valid) {
        const Vec3d normal = scaled_normal(set.triangles[id]);
        const double length = norm(normal);
        total += length;
        aligned += largest_cosine(axes, normal) >= axis_cosine * length ? length : 0;
    }
    return total > 0 ? aligned / total : 1;
}

} // namespace bsp
