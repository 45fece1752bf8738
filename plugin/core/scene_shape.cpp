#include "scene_shape.h"

#include <algorithm>
#include <cmath>

#include "direction.h"
#include "random.h"

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
    const auto area_of = [&](std::uint32_t id) { return norm(scaled_normal(set.triangles[id])); };
    std::vector<SampledTriangle> sample;
    if (set.valid.size() <= sample_size) {
        for (const std::uint32_t id : set.valid)
            if (const double area = area_of(id); area > 0) // some are too small for their normals to be computed
                sample.push_back({id, area});
        return sample;
    }
    double total = 0;
    for (const std::uint32_t id : set.valid)
        total += area_of(id);
    // A place in each of as many equal parts of the area, not the same in each: scenes may repeat themselves.
    Random random(1);
    const double part = total / double(sample_size);
    double passed = 0, parts = 0, next = part * random.uniform();
    for (const std::uint32_t id : set.valid) {
        passed += area_of(id);
        double area = 0;
        for (; next < passed; next = part * (++parts + random.uniform()))
            area += part;
        if (area > 0)
            sample.push_back({id, area});
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
