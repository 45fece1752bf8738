#include <gtest/gtest.h>

#include "builder.h"
#include "helpers.h"
#include "sweep.h"

using namespace bsp;

namespace {

/// A small triangle in the plane x = at.
Triangle wall(float at) { return {{at, 0, 0}, {at, 1, 0}, {at, 0, 1}}; }
/// A triangle from x = low to x = high.
Triangle from_to(float low, float high) { return {{low, 0, 0}, {high, 1, 0}, {low, 0, 1}}; }

const Direction x_axis{0, 0, 0};
const Cell unit_cell(Bounds{{0, 0, 0}, {10, 1, 1}});

CostModel plain_cost() {
    CostModel cost;
    cost.intersection_cost = 1;
    cost.leaf_cost = 0;
    cost.empty_bonus = 1;
    return cost;
}

/// 2 (1 * 1 + 2 * length) of a bar of cross-section 1 x 1.
double bar_area(double length) { return 2 + 4 * length; }

TEST(Sweep, CheapestPlaneByHand) {
    // Two triangles at the left end, one at the right: cutting after 2 leaves 2 and 1 references.
    const ReferenceList references = make_references(make_set({from_to(0, 1), from_to(1, 2), from_to(8, 9)}));
    const auto plane = sweep(references, unit_cell, x_axis, plain_cost());
    ASSERT_TRUE(plane);
    EXPECT_EQ(plane->offset, 2.0f);
    EXPECT_EQ(plane->below, 2u);
    EXPECT_EQ(plane->above, 1u);
    EXPECT_DOUBLE_EQ(plane->cost, (2 * bar_area(2) + bar_area(8)) / bar_area(10));
}

TEST(Sweep, VisitsOfLeavesHaveTheirPrice) {
    CostModel cost = plain_cost();
    cost.leaf_cost = 3;
    EXPECT_EQ(cost.leaf_price(0), 0);
    EXPECT_EQ(cost.leaf_price(2), 5);
    // Cutting between the triangles would save tests, but a ray would visit two leaves more often than it saves.
    const ReferenceList references = make_references(make_set({from_to(0, 1), from_to(1, 2), from_to(2, 3)}));
    const auto plane = sweep(references, unit_cell, x_axis, cost);
    ASSERT_TRUE(plane);
    EXPECT_EQ(plane->offset, 3.0f);
    EXPECT_EQ(plane->above, 0u);
    EXPECT_DOUBLE_EQ(plane->cost, 6 * bar_area(3) / bar_area(10));
}

TEST(Sweep, TrianglesThatCrossAreOnBothSides) {
    const ReferenceList references = make_references(make_set({from_to(0, 6), from_to(1, 2), from_to(4, 10)}));
    const auto plane = sweep(references, unit_cell, x_axis, plain_cost());
    ASSERT_TRUE(plane);
    const auto [below, above] = split_references(references, x_axis, *plane);
    EXPECT_EQ(below.size(), plane->below);
    EXPECT_EQ(above.size(), plane->above);
    EXPECT_GT(below.size() + above.size(), 3u);
}

TEST(Sweep, PlanarTrianglesGoToTheCheaperSide) {
    // Only walls at 4: a thinner part below the plane, so they belong there.
    const ReferenceList references = make_references(make_set({wall(4), wall(4), wall(4)}));
    const auto plane = sweep(references, unit_cell, x_axis, plain_cost());
    ASSERT_TRUE(plane);
    EXPECT_EQ(plane->offset, 4.0f);
    EXPECT_TRUE(plane->planar_below);
    EXPECT_EQ(plane->below, 3u);
    EXPECT_EQ(plane->above, 0u);
    const auto [below, above] = split_references(references, x_axis, *plane);
    EXPECT_EQ(below.size(), 3u);
    EXPECT_EQ(above.size(), 0u);
}

TEST(Sweep, EmptySpaceIsRewarded) {
    const ReferenceList references = make_references(make_set({from_to(6, 7), from_to(6, 7)}));
    CostModel cost = plain_cost();
    cost.empty_bonus = 0.5;
    const auto plane = sweep(references, unit_cell, x_axis, cost);
    ASSERT_TRUE(plane);
    EXPECT_EQ(plane->offset, 6.0f);
    EXPECT_EQ(plane->below, 0u);
    EXPECT_DOUBLE_EQ(plane->cost, 0.5 * 2 * bar_area(4) / bar_area(10));
}

TEST(Sweep, NothingWhenNoEndPointIsInside) {
    const ReferenceList references = make_references(make_set({from_to(0, 10), from_to(0, 10)}));
    EXPECT_FALSE(sweep(references, unit_cell, x_axis, plain_cost()));
}

/// The sweep against the obvious O(n^2) search, in oblique directions and cells, with the counts of the real split.
TEST(Sweep, EqualsExhaustiveSearch) {
    Random random(11);
    for (int trial = 0; trial < 60; ++trial) {
        const TriangleSet set = random_soup(40, std::uint64_t(trial));
        ReferenceList references = make_references(set);
        Cell cell(root_box(set));
        const Direction cut = make_direction({random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5});
        if (trial % 2) {
            SweptPlane middle;
            middle.offset = 0.1f;
            references = split_references(references, cut, middle).first;
            cell = cell.split(cut, 0.1f)->first;
        }
        const Direction direction =
            trial % 3 ? make_direction({random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5})
                      : Direction{};
        const CostModel cost = plain_cost();
        const auto plane = sweep(references, cell, direction, cost);
        ASSERT_TRUE(plane);
        const auto [below, above] = split_references(references, direction, *plane);
        EXPECT_EQ(below.size(), plane->below);
        EXPECT_EQ(above.size(), plane->above);

        double best = HUGE_VAL;
        for (std::size_t i = 0; i < references.size(); ++i) {
            const auto [low, high] = references.extent(i, direction);
            for (const float offset : {float(low), float(high)}) {
                const auto parts = cell.split(direction, offset);
                if (!parts)
                    continue;
                std::size_t n_below = 0, n_above = 0;
                for (std::size_t j = 0; j < references.size(); ++j) {
                    const auto [l, h] = references.extent(j, direction);
                    n_below += l < offset;
                    n_above += h > offset;
                }
                best = std::min(best, (parts->first.area() * double(n_below) + parts->second.area() * double(n_above)) /
                                          cell.area());
            }
        }
        // Rounded to the other side of an end point, the exhaustive search may count one reference more.
        EXPECT_LE(plane->cost, best * (1 + 1e-9));
        EXPECT_GE(plane->cost, best * 0.9);
    }
}

TEST(Sweep, EstimateIsNearTheExactPrice) {
    const TriangleSet set = random_soup(2000, 21);
    const Cell cell(root_box(set));
    const ReferenceList references = make_references(set);
    for (const Vec3d &vector : {Vec3d{1, 0, 0}, Vec3d{1, 2, 3}, Vec3d{-1, 1, 0}}) {
        const Direction direction = make_direction(vector);
        const auto exact = sweep(references, cell, direction, {}), likely = estimate(references, cell, direction, {});
        ASSERT_TRUE(exact && likely);
        EXPECT_GE(likely->cost, exact->cost * (1 - 1e-9));
        EXPECT_LE(likely->cost, exact->cost * 1.05);
    }
}

TEST(References, PartsCoverTheWhole) {
    const ReferenceList references = make_references(random_soup(200, 3));
    const Direction direction = make_direction({1, 0.3, -0.7});
    SweptPlane plane;
    plane.offset = 0.05f;
    const auto [below, above] = split_references(references, direction, plane);
    const auto area = [](const ReferenceList &list) {
        double sum = 0;
        for (std::size_t i = 0; i < list.size(); ++i)
            for (std::uint32_t v = list.starts[i] + 2; v < list.starts[i + 1]; ++v)
                sum += norm(cross(list.vertices[v - 1] - list.vertices[list.starts[i]],
                                  list.vertices[v] - list.vertices[list.starts[i]]));
        return sum;
    };
    EXPECT_NEAR(area(below) + area(above), area(references), 1e-12 * area(references));
    for (std::size_t i = 0; i < below.size(); ++i)
        EXPECT_LE(below.extent(i, direction).second, plane.offset + 1e-15);
    for (std::size_t i = 0; i < above.size(); ++i)
        EXPECT_GE(above.extent(i, direction).first, plane.offset - 1e-15);
}

} // namespace
