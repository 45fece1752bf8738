#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "helpers.h"
#include "scene_shape.h"

using namespace bsp;

namespace {

double total(const std::vector<SampledTriangle> &sample) {
    double sum = 0;
    for (const SampledTriangle &sampled : sample)
        sum += sampled.area;
    return sum;
}

double doubled_area(const TriangleSet &set) {
    double sum = 0;
    for (const std::uint32_t id : set.valid)
        sum += norm(scaled_normal(set.triangles[id]));
    return sum;
}

double directions_of(const TriangleSet &set) { return direction_count(facings_of(set, sample_by_area(set))); }

TEST(SceneShape, FewTrianglesAreAllInTheSample) {
    const TriangleSet set = random_soup(500, 1);
    const auto sample = sample_by_area(set);
    ASSERT_EQ(sample.size(), set.valid.size());
    EXPECT_DOUBLE_EQ(total(sample), doubled_area(set));
}

TEST(SceneShape, OfManyTheLargeAreAndWeighWhatTheyAre) {
    TriangleSet set = random_soup(50000, 2);
    std::vector<Triangle> triangles = set.triangles;
    const float wall = 10;
    triangles.insert(triangles.begin() + 20000, Triangle{{0, 0, 0}, {wall, 0, 0}, {0, wall, 0}});
    set = make_set(triangles);
    const auto sample = sample_by_area(set);
    EXPECT_LE(sample.size(), 4096u);
    EXPECT_NEAR(total(sample), doubled_area(set), 1e-3 * doubled_area(set));
    double found = 0;
    for (const SampledTriangle &sampled : sample)
        if (sampled.id == 20000)
            found = sampled.area;
    EXPECT_NEAR(found, wall * wall, 1e-3 * doubled_area(set));
}

TEST(SceneShape, WallsFaceInThreeDirectionsHoweverTheyStand) {
    EXPECT_NEAR(directions_of(grid_of_boxes(12, 0)), 3, 0.5);
    EXPECT_NEAR(directions_of(grid_of_boxes(12, 0.5f)), 3, 0.5);
    EXPECT_GT(directions_of(random_soup(5000, 3)), 500);
    EXPECT_EQ(directions_of(TriangleSet{}), 0);
}

/// Boxes that are all alike to the last bit, askew.
TriangleSet equal_boxes(int side) {
    const Vec3f u{1, 2, 2}, v{2, 1, -2}, w{2, -2, 1};
    std::vector<Triangle> triangles;
    for (int x = 0; x < side; ++x)
        for (int y = 0; y < side; ++y)
            for (int z = 0; z < side; ++z) {
                const Vec3f at = u * float(2 * x) + v * float(2 * y) + w * float(2 * z);
                for (const auto &[a, b, up] : {std::array{u, v, w}, std::array{v, w, u}, std::array{w, u, v}})
                    for (const Vec3f &corner : {at, at + up}) {
                        triangles.push_back({corner, corner + a, corner + b});
                        triangles.push_back({corner + a + b, corner + a, corner + b});
                    }
            }
    return make_set(triangles);
}

TEST(SceneShape, WhatRepeatsItselfIsSeenFromAllSides) {
    for (const int side : {8, 16, 20}) {
        const TriangleSet set = equal_boxes(side);
        EXPECT_NEAR(directions_of(set), 3, 0.1) << side;
        EXPECT_NEAR(axis_share(set, find_orientation(set)), 1, 1e-6) << side;
    }
}

TEST(SceneShape, FacingsAreTheLargestFirstAndKeepTheirLargestTriangle) {
    const TriangleSet set = make_set({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}},
                                      {{0, 0, 5}, {0, 3, 5}, {3, 0, 5}}, // the other way round, and larger
                                      {{0, 0, 0}, {0, 2, 0}, {0, 0, 2}}});
    const auto facings = facings_of(set, sample_by_area(set));
    ASSERT_EQ(facings.size(), 2u);
    EXPECT_EQ(facings[0].largest, 1u);
    EXPECT_DOUBLE_EQ(facings[0].area, 10);
    EXPECT_DOUBLE_EQ(std::abs(facings[0].normal.z), 1);
    EXPECT_EQ(facings[1].largest, 2u);
}

TEST(SceneShape, BoxesAreTightWhereFacesLieAlongTheAxes) {
    const TriangleSet straight = grid_of_boxes(12, 0), askew = grid_of_boxes(12, 0.5f);
    EXPECT_NEAR(box_share(straight, sample_by_area(straight)), 2, 1e-6);
    EXPECT_GT(box_share(askew, sample_by_area(askew)), 2.5);
    EXPECT_NEAR(box_share(askew, sample_by_area(askew), find_orientation(askew)), 2, 1e-5);
    EXPECT_EQ(box_share(TriangleSet{}, {}), 0);
}

TEST(SceneShape, SliversAcrossTheAxesFillLittleOfTheirBoxes) {
    const TriangleSet sliver = make_set({{{0, 0, 0}, {1, 1, 1}, {1, 1.01f, 1}}});
    EXPECT_GT(box_share(sliver, sample_by_area(sliver)), 100);
}

} // namespace
