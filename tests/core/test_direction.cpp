#include <gtest/gtest.h>

#include "direction.h"
#include "fixed_directions.h"
#include "helpers.h"
#include "random.h"
#include "split_source.h"

using namespace bsp;

namespace {

TEST(Direction, LargestComponentIsOne) {
    const Direction d = make_direction({2, -4, 1});
    EXPECT_EQ(d.major, 1);
    EXPECT_EQ(d.normal(), (Vec3d{-0.5, 1, -0.25}));
    EXPECT_EQ(position(d, {1, 2, 3}), -0.5 + 2 - 0.75);
}

TEST(Direction, OppositeVectorsAreOneFamily) {
    Random random(3);
    for (int i = 0; i < 1000; ++i) {
        const Vec3d v{random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5};
        EXPECT_EQ(make_direction(v), make_direction(v * -3.0));
    }
}

TEST(Direction, NearAnAxisIsTheAxis) {
    EXPECT_TRUE(make_direction({1e-5, -3, 1e-5}).is_axis());
    EXPECT_FALSE(make_direction({1e-3, -3, 1e-3}).is_axis());
    EXPECT_TRUE(nearly_parallel(make_direction({1, 1, 0}), make_direction({-1, -1.0001, 0}), 1e-3));
    EXPECT_FALSE(nearly_parallel(make_direction({1, 1, 0}), make_direction({1, -1, 0}), 1e-3));
}

/// The directions of a tree's source for all triangles of a set.
std::vector<Direction> directions_of(const char *tree, const TriangleSet &set, int count, std::uint64_t seed,
                                     const Options &options = {}) {
    const ReferenceList references = make_references(set);
    return make_split_source(make_settings(tree, options))->directions({set, references}, count, Random(seed));
}

/// Triangles of three orientations, many of each.
TriangleSet three_orientations() {
    std::vector<Triangle> triangles;
    Random random(4);
    for (int i = 0; i < 300; ++i) {
        const Vec3f p = random_point(random);
        if (i % 3 == 0)
            triangles.push_back({p, p + Vec3f{1, 0, 0}, p + Vec3f{0, 1, 1}});
        else if (i % 3 == 1)
            triangles.push_back({p, p + Vec3f{0, 1, 0}, p + Vec3f{1, 0, 2}});
        else
            triangles.push_back({p, p + Vec3f{0, 1, 1}, p + Vec3f{1, 0, 0}}); // the first one's opposite
    }
    return make_set(triangles);
}

TEST(SplitSource, NormalsAreThoseOfTheTriangles) {
    const TriangleSet set = three_orientations();
    const auto found = directions_of("normals", set, 6, 5);
    ASSERT_EQ(found.size(), 2u); // distinct ones only: a normal and its opposite are one direction
    const Direction first = make_direction({0, -1, 1}), second = make_direction({2, 0, -1});
    EXPECT_TRUE((found[0] == first && found[1] == second) || (found[0] == second && found[1] == first));
}

TEST(SplitSource, ClustersFindTheOrientations) {
    const TriangleSet set = three_orientations();
    const auto found = directions_of("clustered", set, 5, 6);
    ASSERT_EQ(found.size(), 2u);
    for (const Vec3d &expected : {Vec3d{0, -1, 1}, Vec3d{2, 0, -1}})
        EXPECT_TRUE(nearly_parallel(found[0], make_direction(expected), 1e-4) ||
                    nearly_parallel(found[1], make_direction(expected), 1e-4));
}

TEST(SplitSource, RandomDirectionsFillTheSphere) {
    const TriangleSet set = random_soup(5, 7);
    int majors[3] = {};
    for (std::uint64_t seed = 0; seed < 300; ++seed)
        for (const Direction &d : directions_of("random", set, 4, seed))
            ++majors[d.major];
    for (const int count : majors)
        EXPECT_NEAR(count, 400, 60);
}

TEST(SplitSource, SameSeedSameDirections) {
    const TriangleSet set = random_soup(500, 8);
    for (const char *tree : {"random", "normals", "clustered"}) {
        const auto once = directions_of(tree, set, 6, 9);
        EXPECT_EQ(once, directions_of(tree, set, 6, 9));
        EXPECT_EQ(once.size(), 6u);
        EXPECT_NE(once, directions_of(tree, set, 6, 10));
    }
}

TEST(SplitSource, AreaWeightingPrefersLargeTriangles) {
    std::vector<Triangle> triangles;
    Random random(11);
    for (int i = 0; i < 200; ++i) {
        const Vec3f p = random_point(random);
        const float size = i == 77 ? 1000.f : 0.01f;
        const Vec3f tilt = i == 77 ? Vec3f{0, 1, 1} : Vec3f{0, 1, 0.01f * float(i)};
        triangles.push_back({p, p + Vec3f{size, 0, 0}, p + tilt * size});
    }
    const TriangleSet set = make_set(triangles);
    const Direction large = make_direction({0, -1, 1});
    for (const char *tree : {"normals", "clustered"}) {
        const auto found = directions_of(tree, set, 1, 12, {{"weighting", "area"}});
        ASSERT_EQ(found.size(), 1u) << tree;
        EXPECT_TRUE(nearly_parallel(found[0], large, 1e-3)) << tree;
    }
}

TEST(FixedDirections, SetsOfThePapers) {
    for (const int k : {3, 7, 9, 13}) {
        const auto directions = fixed_directions(DirectionSet::kdop, k);
        EXPECT_EQ(directions.size(), std::size_t(k));
    }
    for (int k = 3; k <= 32; ++k) {
        const auto directions = fixed_directions(DirectionSet::spiral, k);
        ASSERT_EQ(directions.size(), std::size_t(k));
        for (std::size_t i = 0; i < directions.size(); ++i)
            for (std::size_t j = 0; j < i; ++j)
                EXPECT_FALSE(nearly_parallel(directions[i], directions[j], 0.01)) << k << ": " << i << ", " << j;
    }
    const auto diagonals = fixed_directions(DirectionSet::kdop, 7);
    EXPECT_EQ(diagonals[3], (Direction{0, 1, 1}));
    EXPECT_EQ(diagonals[6], (Direction{0, -1, -1}));
}

} // namespace
