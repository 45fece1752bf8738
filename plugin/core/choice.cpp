#include "choice.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <optional>
#include <sstream>

#include "builder.h"
#include "expected_work.h"
#include "orientation.h"
#include "parallel.h"
#include "random.h"
#include "scene_shape.h"
#include "standard_floats.h"

namespace bsp {
namespace {

/// A tree that may be chosen, and what it takes next to `kd`: measured on the shared and the built-in scenes.
struct Candidate {
    const char *tree;
    Options options;
    double build;      ///< time to build
    double trace;      ///< time of a ray, where the pilots say that `normals` costs what `kd` does
    bool is_oblique;   ///< the pilots' ratio counts
    double directions; ///< only where the triangles face in at least so many
};

const std::vector<Candidate> &candidates() {
    static const std::vector<Candidate> list{
        {"kd", {{"bad_refines", "0"}, {"leaf_size", "64"}}, 0.57, 1.18, false, 0},
        {"kd", {{"bad_refines", "0"}}, 0.71, 1.04, false, 0},
        {"kd", {}, 1, 1, false, 0},
        {"normals", {{"bad_refines", "0"}}, 1.27, 1.11, true, 0},
        {"normals", {}, 2.1, 1.08, true, 0},
        {"normals", {{"k", "9"}}, 2.7, 1.06, true, 9},
    };
    return list;
}

/// Nanoseconds of one thread: what a ray's work takes, fitted to replayed rays of eleven scenes.
double ray_ns(const Work &work) {
    return 11.4 * work.axis_nodes + 16.2 * work.oblique_nodes + 8.9 * work.leaves + 0.96 * work.tests;
}

/// Seconds of one thread.
double kd_build_seconds(double triangles) { return 165e-9 * triangles * std::log2(triangles + 1); }

/// Seconds of one thread: a ray's own, those on the way down to a pilot, `levels` deep, and those inside it; caches
/// that miss make a quarter more.
double kd_ray_seconds(double pilot_ns, double levels) { return 1.25e-9 * (30 + 10 * levels + pilot_ns); }

constexpr double axis_aligned = 0.98; ///< share of the area from which on nothing oblique is tried
constexpr double tight_boxes = 2.5;   ///< `box_share` up to which oblique planes are not tried: there is little to save
/// So much more of the area must lie along the scene's own axes than along the user's. They have their price: a ray is
/// turned, and the walls are no longer flat to the last bit.
constexpr double worth_turning = 0.1;
constexpr double hoped_for_ratio = 0.75; ///< pilots are not flown where even this would save less than they take,
constexpr double pilots_share = 0.1;     ///< at most so much of building `kd`
constexpr double typical_pilot_ns = 60;

/// What the pilots found: parts of the scene, built as `kd` and as `normals`.
struct Pilots {
    std::size_t count = 0, size = 0; ///< how many, and the triangles of each
    Work kd, normals;                ///< sums over all of them

    double kd_ns() const { return ray_ns(kd) / double(count); }
    double ratio() const { return ray_ns(normals) / ray_ns(kd); }
};

/// How many pilots, and of how many triangles each: together at most a 64th of `n`, if there is so much, so that
/// choosing takes a small part of building.
Pilots plan_pilots(std::size_t n) {
    constexpr std::size_t usual_size = 256, least_size = 64, most = 16, share = 64;
    Pilots pilots;
    pilots.size = std::min({n, usual_size, std::max(least_size, n / share)});
    pilots.count = std::clamp<std::size_t>(n / (share * usual_size), 1, most);
    if (pilots.count == 1 && pilots.size >= 2 * least_size) { // two small ones see more of the scene
        pilots.size /= 2;
        pilots.count = 2;
    }
    return pilots;
}

/// The `size` valid triangles nearest to one of them. `nearest` is scratch: all valid ids, in any order.
TriangleSet neighbourhood(const TriangleSet &set, std::uint32_t middle, std::size_t size,
                          std::vector<std::uint32_t> &nearest) {
    const Vec3d centre = to_double(set.triangles[middle].a);
    const auto distance = [&](std::uint32_t id) {
        const Vec3d away = to_double(set.triangles[id].a) - centre;
        return dot(away, away);
    };
    std::nth_element(nearest.begin(), nearest.begin() + std::ptrdiff_t(size - 1), nearest.end(),
                     [&](std::uint32_t x, std::uint32_t y) {
                         const double dx = distance(x), dy = distance(y);
                         return dx != dy ? dx < dy : x < y;
                     });
    std::vector<std::uint32_t> ids(nearest.begin(), nearest.begin() + std::ptrdiff_t(size));
    std::sort(ids.begin(), ids.end());
    TriangleSet part;
    for (const std::uint32_t id : ids) {
        const Triangle &triangle = set.triangles[id];
        part.valid.push_back(std::uint32_t(part.triangles.size()));
        part.triangles.push_back(triangle);
        for (const Vec3f &v : {triangle.a, triangle.b, triangle.c})
            part.bounds.extend(to_double(v));
    }
    return part;
}

Pilots fly_pilots(const TriangleSet &set, const Orientation &orientation, std::uint64_t seed, BuildMonitor *monitor) {
    const std::size_t n = set.valid.size();
    Pilots pilots = plan_pilots(n);
    Settings kd = make_settings("kd", {}), normals = make_settings("normals", {});
    normals.seed = seed;
    Random random(seed);
    std::vector<std::uint32_t> middles;
    for (std::size_t i = 0; i < pilots.count; ++i)
        middles.push_back(set.valid[random.below(std::uint32_t(n))]);
    std::vector<std::pair<Work, Work>> found(pilots.count);
    parallel_for(pilots.count, 1, [&](std::size_t begin, std::size_t end) {
        std::vector<std::uint32_t> nearest = set.valid;
        for (std::size_t i = begin; i < end; ++i) {
            if (monitor)
                monitor->check();
            TriangleSet part = neighbourhood(set, middles[i], pilots.size, nearest);
            if (orientation.turns())
                part = orientation.seen(part);
            const Work kd_work = expected_work(build_tree(part, kd));
            const bool is_aligned = axis_share(part) >= axis_aligned;
            found[i] = {kd_work, is_aligned ? kd_work : expected_work(build_tree(part, normals))};
        }
    });
    for (const auto &[kd_work, normals_work] : found) {
        pilots.kd.add(kd_work);
        pilots.normals.add(normals_work);
    }
    return pilots;
}

/// A candidate with its predicted seconds of one thread.
struct Prediction {
    const Candidate *candidate = nullptr;
    double build_s = 0, trace_s = 0;

    double total_s() const { return build_s + trace_s; }
};

/// The candidate that takes the least time, the oblique ones only where a `ratio` is given.
Prediction best_candidate(double n, double directions, double ray_s, double rays, std::optional<double> ratio) {
    Prediction best;
    for (const Candidate &candidate : candidates()) {
        if ((candidate.is_oblique && !ratio) || directions < candidate.directions)
            continue;
        const double trace = candidate.trace * (candidate.is_oblique ? *ratio : 1) * ray_s * rays;
        const Prediction found{&candidate, candidate.build * kd_build_seconds(n), trace};
        if (!best.candidate || found.total_s() < best.total_s())
            best = found;
    }
    return best;
}

Settings settings_of(const Candidate &candidate, const Orientation &orientation, const Settings &wanted) {
    Settings chosen = make_settings(candidate.tree, candidate.options);
    chosen.orientation = orientation.turns() ? OrientationKind::scene : OrientationKind::user;
    chosen.seed = wanted.seed;
    chosen.triangle_test = wanted.triangle_test;
    chosen.simd = wanted.simd;
    chosen.precision = wanted.precision;
    chosen.early_exit = wanted.early_exit;
    chosen.max_depth = wanted.max_depth;
    chosen.depth_margin = wanted.depth_margin;
    chosen.max_references = wanted.max_references;
    return chosen;
}

std::string short_spec(const Candidate &candidate) {
    std::string text = candidate.tree;
    for (const auto &[name, value] : candidate.options)
        text += (text == candidate.tree ? ":" : ",") + name + "=" + value;
    return text;
}

} // namespace

Choice choose_tree(const TriangleSet &set, const Settings &settings, BuildMonitor *monitor) {
    if (settings.tree != TreeKind::automatic)
        return {settings, "", 0, 0};
    const StandardFloats floats;
    const double n = double(set.size()), rays = settings.expected_rays;
    const double pilot_size = double(std::max<std::size_t>(1, plan_pilots(set.valid.size()).size));
    const double levels = std::log2(std::max(1.0, n / pilot_size));
    std::ostringstream reason;
    reason.precision(3);
    double aligned = axis_share(set), directions = 0, boxes = 0;
    reason << std::round(100 * aligned) << " % of the area lies along the axes";
    Orientation orientation;
    if (aligned < axis_aligned) {
        const std::vector<SampledTriangle> sample = sample_by_area(set);
        const std::vector<Facing> facings = facings_of(set, sample);
        const Orientation found = find_orientation(set, facings, aligned + worth_turning);
        const double turned = found.turns() ? axis_share(set, found) : 0; // what it was found by is an estimate
        if (turned >= aligned + worth_turning) {
            orientation = found;
            aligned = turned;
            reason << ", " << std::round(100 * aligned) << " % along those of the scene itself";
        }
        directions = direction_count(facings);
        boxes = box_share(set, sample, orientation);
        reason << "; it faces in " << std::lround(directions) << " directions, its boxes are " << boxes
               << " times as large";
    }
    const auto best_with = [&](double ray_s, std::optional<double> ratio) {
        return best_candidate(n, directions, ray_s, rays, ratio);
    };
    double ray_s = kd_ray_seconds(typical_pilot_ns, levels);
    std::optional<double> ratio;
    const double hoped_for_s = best_with(ray_s, {}).total_s() - best_with(ray_s, hoped_for_ratio).total_s();
    if (aligned < axis_aligned && boxes > tight_boxes && hoped_for_s > pilots_share * kd_build_seconds(n)) {
        const Pilots pilots = fly_pilots(set, orientation, settings.seed, monitor);
        ray_s = kd_ray_seconds(pilots.kd_ns(), levels);
        ratio = pilots.ratio();
        reason << ", " << pilots.count << " parts of " << pilots.size << " triangles cost rays " << *ratio
               << " times as much under normals as under kd";
    }
    const Prediction best = best_with(ray_s, ratio);
    reason << ": " << short_spec(*best.candidate) << (orientation.turns() ? " in these" : "")
           << ", predicted to take one thread " << best.build_s << " s to build and " << best.trace_s << " s to trace "
           << std::setprecision(12) << rays << " rays";
    return {settings_of(*best.candidate, orientation, settings), reason.str(), best.build_s, best.trace_s};
}

} // namespace bsp
