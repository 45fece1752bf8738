#include "scene_shape.h"

#include <algorithm>
#include <cmath>

#include "direction.h"

namespace bsp {
namespace {

constexpr std::size_t sample_size = 1 << 12;
constexpr unsigned bins = 63; ///< along each side of a cube's face; odd, so that 0 is inside of one

unsigned bin_of(const Direction &direction) {
    const auto bin = [](float slope) { return std::min(bins - 1, unsigned((slope + 1) * (0.5f * bins))); };
    return (direction.major * bins + bin(direction.a)) * bins + bin(direction.b);
}

} // namespace

std::vector<SampledTriangle> sample_by_area(const TriangleSet &set) {
    std::vector<double> areas;
    areas.reserve(set.valid.size());
    double total = 0;
    for (const std::uint32_t id : set.valid) {
        areas.push_back(norm(scaled_normal(set.triangles[id])));
        total += areas.back();
    }
    std::vector<SampledTriangle> sample;
    const bool takes_all = areas.size() <= sample_size;
    const double step = total / double(sample_size);
    double before = 0;
    for (std::size_t i = 0; i < areas.size(); ++i) {
        const double after = before + areas[i];
        const double area = takes_all ? areas[i] : step * (std::floor(after / step) - std::floor(before / step));
        if (area > 0) // some are too small for their normals to be computed
            sample.push_back({set.valid[i], area});
        before = after;
    }
    return sample;
}

std::vector<Facing> facings_of(const TriangleSet &set, const std::vector<SampledTriangle> &sample) {
    struct Binned {
        unsigned bin;
        Facing facing;
    };
    std::vector<Binned> binned;
    binned.reserve(sample.size());
    for (const SampledTriangle &sampled : sample) {
        const Vec3d normal = scaled_normal(set.triangles[sampled.id]);
        const double own = norm(normal);
        binned.push_back({bin_of(make_direction(normal)), {sampled.area, own, sampled.id, normal * (1 / own)}});
    }
    std::sort(binned.begin(), binned.end(), [](const Binned &x, const Binned &y) {
        return x.bin != y.bin ? x.bin < y.bin : x.facing.largest < y.facing.largest;
    });
    std::vector<Facing> facings;
    for (std::size_t i = 0; i < binned.size(); ++i) {
        const Facing &next = binned[i].facing;
        if (i == 0 || binned[i].bin != binned[i - 1].bin) {
            facings.push_back(next);
            continue;
        }
        Facing &facing = facings.back();
        const double area = facing.area + next.area;
        if (next.largest_area > facing.largest_area)
            facing = next;
        facing.area = area;
    }
    std::sort(facings.begin(), facings.end(), [](const Facing &x, const Facing &y) {
        return x.area != y.area ? x.area > y.area : x.largest < y.largest;
    });
    return facings;
}

double direction_count(const std::vector<Facing> &facings) {
    double sum = 0, squares = 0;
    for (const Facing &facing : facings) {
        sum += facing.area;
        squares += facing.area * facing.area;
    }
    return squares > 0 ? sum * sum / squares : 0;
}

double box_share(const TriangleSet &set, const std::vector<SampledTriangle> &sample, const Orientation &orientation) {
    double boxes = 0, area = 0;
    for (const SampledTriangle &sampled : sample) {
        const Triangle &t = set.triangles[sampled.id];
        Bounds box;
        for (const Vec3f &v : {t.a, t.b, t.c})
            box.extend(orientation.turns() ? orientation.seen(to_double(v)) : to_double(v));
        const Vec3d size = box.upper - box.lower;
        const double half = size.x * size.y + size.y * size.z + size.z * size.x;
        boxes += sampled.area * half / (0.5 * norm(scaled_normal(t)));
        area += sampled.area;
    }
    return area > 0 ? boxes / area : 0;
}

} // namespace bsp
