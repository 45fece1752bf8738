#include <gtest/gtest.h>

#include <nanothread/nanothread.h>

#include "builder.h"
#include "helpers.h"
#include "reference_hierarchy.h"
#include "side_areas.h"
#include "triangle_planes.h"

using namespace bsp;

namespace {

constexpr double no_limit = HUGE_VAL;

CostModel plain_cost() {
    CostModel cost;
    cost.intersection_cost = 1;
    cost.leaf_cost = 0;
    cost.empty_bonus = 1;
    return cost;
}

Direction random_direction(Random &random) {
    return make_direction({random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5});
}

/// Turned by fixed angles, so that nothing lies along an axis; rounded to floats.
Vec3f turned(const Vec3d &p) {
    const double c = std::cos(0.7), s = std::sin(0.7);
    const Vec3d q{c * p.x - s * p.y, s * p.x + c * p.y, p.z};
    const Vec3d r{q.x, c * q.y - s * q.z, s * q.y + c * q.z};
    return {float(r.x), float(r.y), float(r.z)};
}

/// The twelve triangles of the turned box [-1, 1]^3.
TriangleSet turned_box() {
    std::vector<Triangle> triangles;
    for (std::size_t axis = 0; axis < 3; ++axis)
        for (const double side : {-1.0, 1.0}) {
            Vec3f corners[4];
            for (unsigned i = 0; i < 4; ++i) {
                Vec3d p;
                p[axis] = side;
                p[next_axis[axis]] = i & 1 ? 1 : -1;
                p[after_axis[axis]] = i & 2 ? 1 : -1;
                corners[i] = turned(p);
            }
            triangles.push_back({corners[0], corners[1], corners[2]});
            triangles.push_back({corners[1], corners[3], corners[2]});
        }
    return make_set(triangles);
}

SideCounts count(const TriangleSet &set, const TrianglePlane &plane) {
    const ReferenceList references = make_references(set);
    const ReferenceHierarchy hierarchy(references, plane_tolerance(set.bounds));
    ReferenceHierarchy::Scratch scratch;
    const auto counts = hierarchy.count(plane.direction, plane.offset, SidePrices{}, scratch);
    EXPECT_TRUE(counts);
    EXPECT_LE(scratch.work, references.size());
    return counts.value_or(SideCounts{});
}

TEST(TrianglePlanes, HoldTheirTriangleAndItsEdges) {
    Random random(21);
    for (const float at : {0.0f, 1e3f, 2.7e5f})
        for (int trial = 0; trial < 300; ++trial) {
            const Vec3f shift{at, -at, at};
            const Triangle t{random_point(random) + shift, random_point(random) + shift, random_point(random) + shift};
            const TriangleSet set = make_set({t});
            const auto planes = planes_along(t);
            const double tolerance = plane_tolerance(set.bounds);
            const Vec3d corners[3] = {to_double(t.a), to_double(t.b), to_double(t.c)};
            for (const Vec3d &corner : corners)
                EXPECT_LE(std::abs(position(planes[0].direction, corner) - planes[0].offset), tolerance);
            for (std::size_t edge = 0; edge < 3; ++edge) {
                const TrianglePlane &plane = planes[edge + 1];
                for (const Vec3d &corner : {corners[edge], corners[next_axis[edge]]})
                    EXPECT_LE(std::abs(position(plane.direction, corner) - plane.offset), tolerance);
                if (!plane.direction.is_axis() && !planes[0].direction.is_axis()) {
                    const Vec3d n = planes[0].direction.normal(), m = plane.direction.normal();
                    EXPECT_NEAR(dot(n, m) / (norm(n) * norm(m)), 0, 1e-6);
                }
            }
        }
}

TEST(ReferenceHierarchy, CountsBelowOnAndAboveByHand) {
    // Around the plane x + y = 1 (its own triangle on it): one below, two above, one across, one with an edge on it.
    const Triangle own{{1, 0, 0}, {0, 1, 0}, {0.5f, 0.5f, 1}};
    const TriangleSet set = make_set({own,
                                      {{0, 0, 0}, {0.4f, 0, 0}, {0, 0.4f, 1}},
                                      {{1, 1, 0}, {2, 1, 0}, {1, 2, 1}},
                                      {{2, 2, 0}, {3, 2, 0}, {2, 3, 1}},
                                      {{0, 0, 0.5f}, {3, 0, 0.5f}, {0, 3, 0.5f}},
                                      {{1, 0, 0}, {0, 1, 0}, {0, 0, -1}}});
    const TrianglePlane plane = planes_along(own)[0];
    EXPECT_NEAR(plane.direction.a, 1, 1e-7);
    EXPECT_NEAR(plane.offset, 1, 1e-7);
    const SideCounts counts = count(set, plane);
    EXPECT_EQ(counts.below, 3u);
    EXPECT_EQ(counts.on, 1u);
    EXPECT_EQ(counts.above, 3u);
}

/// Triangles around an edge: a plane through it keeps each of them on one side.
TEST(ReferenceHierarchy, NeighboursAtAnEdgeAreNotCut) {
    const int count_around = 24;
    std::vector<Triangle> fan;
    for (int i = 0; i < count_around; ++i) {
        const double angle = 2 * M_PI * (i + 0.3) / count_around;
        fan.push_back({turned({0, 0, -1}), turned({0, 0, 1}), turned({std::cos(angle), std::sin(angle), 0.1})});
    }
    const TriangleSet set = make_set(fan);
    for (const Triangle &t : fan)
        for (const std::size_t plane : {0u, 1u}) { // its own, and the one through the edge
            const SideCounts counts = count(set, planes_along(t)[plane]);
            EXPECT_EQ(counts.below + counts.on + counts.above, unsigned(count_around));
            EXPECT_EQ(counts.on, 2u); // itself and the one opposite, or the two at right angles
        }
}

TEST(ReferenceHierarchy, EqualsALoopOverTheReferences) {
    ReferenceHierarchy::Scratch scratch;
    Random random(22);
    for (const std::size_t size : {1u, 7u, 8u, 9u, 64u, 65u, 600u, 5000u}) {
        const TriangleSet set = random_soup(size, size);
        ReferenceList references = in_spatial_order(make_references(set));
        SweptPlane cut;
        cut.offset = 0.3f; // so that there are polygons of more than three corners
        references = split_references(references, random_direction(random), cut).first;
        const double tolerance = plane_tolerance(set.bounds);
        const ReferenceHierarchy hierarchy(references, tolerance);
        for (int trial = 0; trial < 200 && references.size() > 0; ++trial) {
            TrianglePlane plane{random_direction(random), float(random.uniform() - 0.5)};
            if (trial % 2)
                plane = planes_along(set.triangles[random.below(std::uint32_t(size))])[std::size_t(trial) / 2 % 4];
            const auto counts = hierarchy.count(plane.direction, plane.offset, SidePrices{}, scratch);
            ASSERT_TRUE(counts);
            SweptPlane split;
            split.offset = plane.offset;
            split.tolerance = tolerance;
            const auto above_on = split_references(references, plane.direction, split);
            split.planar_below = true;
            const auto below_on = split_references(references, plane.direction, split);
            EXPECT_EQ(above_on.first.size(), counts->below);
            EXPECT_EQ(below_on.second.size(), counts->above);
            EXPECT_EQ(below_on.first.size(), counts->below + counts->on);
            EXPECT_EQ(above_on.second.size(), counts->above + counts->on);
        }
    }
}

TEST(ReferenceHierarchy, GivesUpOnlyWhenTheLimitIsReached) {
    ReferenceHierarchy::Scratch scratch;
    const TriangleSet set = random_soup(500, 23);
    const ReferenceList references = in_spatial_order(make_references(set));
    const ReferenceHierarchy hierarchy(references, plane_tolerance(set.bounds));
    Random random(24);
    for (int trial = 0; trial < 100; ++trial) {
        const Direction direction = random_direction(random);
        SidePrices prices{0.3, 0.8, CostModel{}, no_limit};
        const auto counts = hierarchy.count(direction, 0.2f, prices, scratch);
        const double least = std::min(prices.price(counts->below + counts->on, counts->above),
                                      prices.price(counts->below, counts->above + counts->on));
        prices.limit = least * 1.001;
        EXPECT_TRUE(hierarchy.count(direction, 0.2f, prices, scratch));
        prices.limit = least * 0.5;
        EXPECT_FALSE(hierarchy.count(direction, 0.2f, prices, scratch));
    }
}

TEST(SideAreas, EqualThoseOfTheParts) {
    Random random(25);
    Cell cell(Bounds{{-1, -2, -1}, {1, 1, 3}});
    for (int trial = 0; trial < 400; ++trial) {
        const Direction direction = random_direction(random);
        const float offset = float(random.uniform() - 0.5);
        std::vector<double> heights;
        const auto areas = SideAreas(cell).at(direction, offset, 1e-6, heights);
        const auto parts = cell.split(direction, offset);
        if (areas) {
            ASSERT_TRUE(parts);
            EXPECT_NEAR(areas->first, parts->first.area(), 1e-9 * cell.area());
            EXPECT_NEAR(areas->second, parts->second.area(), 1e-9 * cell.area());
        }
        if (parts && trial % 40 < 12)
            cell = trial % 2 ? parts->first : parts->second;
        else if (trial % 40 == 39)
            cell = Cell(Bounds{{-1, -2, -1}, {1, 1, 3}});
    }
}

TEST(SideAreas, NoSlicesThinnerThanTheMargin) {
    const Cell cell(Bounds{{0, 0, 0}, {1, 1, 1}});
    std::vector<double> heights;
    EXPECT_FALSE(SideAreas(cell).at(Direction{}, 0.05, 0.1, heights));
    EXPECT_FALSE(SideAreas(cell).at(Direction{}, 0.95, 0.1, heights));
    EXPECT_FALSE(SideAreas(cell).at(Direction{}, 2, 0.1, heights));
    EXPECT_TRUE(SideAreas(cell).at(Direction{}, 0.5, 0.1, heights));
}

/// The search against the obvious loop over all planes.
TEST(TrianglePlanes, TheCheapestOfAll) {
    for (const std::size_t size : {20u, 700u}) { // the larger one is searched in parallel
        const TriangleSet set = random_soup(size, 26);
        const ReferenceList references = make_references(set);
        const Cell cell(root_box(set));
        const double tolerance = plane_tolerance(set.bounds);
        const auto found = best_triangle_plane(set, references, cell, plain_cost(), tolerance, no_limit);
        ASSERT_TRUE(found);
        double best = HUGE_VAL;
        for (const Triangle &t : set.triangles)
            for (const TrianglePlane &plane : planes_along(t)) {
                const auto parts = cell.split(plane.direction, plane.offset);
                if (!parts)
                    continue;
                for (const bool planar_below : {false, true}) {
                    SweptPlane split{plane.offset, planar_below, 0, 0, 0, tolerance};
                    const auto [below, above] = split_references(references, plane.direction, split);
                    best = std::min(best, (parts->first.area() * double(below.size()) +
                                           parts->second.area() * double(above.size())) /
                                              cell.area());
                }
            }
        EXPECT_NEAR(found->plane.cost, best, 1e-9 * best);
        const auto [below, above] = split_references(references, found->direction, found->plane);
        EXPECT_EQ(below.size(), found->plane.below);
        EXPECT_EQ(above.size(), found->plane.above);
        EXPECT_TRUE(best_triangle_plane(set, references, cell, plain_cost(), tolerance, best * 1.001));
        EXPECT_FALSE(best_triangle_plane(set, references, cell, plain_cost(), tolerance, best * 0.999));
    }
}

/// All planes of a convex solid: no triangle is ever cut, and its faces come apart.
TEST(TrianglePlanes, FacesOfAClosedBoxAreIsolated) {
    const TriangleSet set = turned_box();
    Settings settings = make_settings("ize", {{"intersection_cost", "100"}});
    const Tree tree = build_tree(set, settings);
    EXPECT_EQ(validate(tree, set), "");
    EXPECT_EQ(tree.references.size(), 12u);
    for (const TreeNode &node : tree.nodes)
        EXPECT_LE(node.count, 2u); // the two halves of a face lie in one plane
}

TEST(TrianglePlanes, SameTreeOnAnyNumberOfThreads) {
    const TriangleSet set = random_soup(5000, 27); // enough for subtrees and searches in parallel
    const std::uint32_t usual = pool_size();
    pool_set_size(nullptr, 1);
    const Tree one = build_tree(set, make_settings("ize", {}));
    for (const std::uint32_t threads : {2u, 8u}) {
        pool_set_size(nullptr, threads);
        const Tree other = build_tree(set, make_settings("ize", {}));
        EXPECT_EQ(other.references, one.references);
        EXPECT_EQ(other.sah_cost, one.sah_cost);
        ASSERT_EQ(other.nodes.size(), one.nodes.size());
        for (std::size_t i = 0; i < one.nodes.size(); ++i)
            EXPECT_TRUE(other.nodes[i].direction == one.nodes[i].direction &&
                        other.nodes[i].offset == one.nodes[i].offset);
    }
    pool_set_size(nullptr, usual);
}

} // namespace
