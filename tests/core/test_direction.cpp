#include <gtest/gtest.h>

#include "direction.h"
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

NodeTriangles all_of(const TriangleSet &set) { return {set, set.valid.data(), set.valid.size()}; }

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
    const auto found = make_split_source(TreeKind::normals)->directions(all_of(set), 6, Random(5));
    ASSERT_EQ(found.size(), 2u); // distinct ones only: a normal and its opposite are one direction
    const Direction first = make_direction({0, -1, 1}), second = make_direction({2, 0, -1});
    EXPECT_TRUE((found[0] == first && found[1] == second) || (found[0] == second && found[1] == first));
}

TEST(SplitSource, ClustersFindTheOrientations) {
    const TriangleSet set = three_orientations();
    const auto found = make_split_source(TreeKind::clustered)->directions(all_of(set), 5, Random(6));
    ASSERT_EQ(found.size(), 2u);
    for (const Vec3d &expected : {Vec3d{0, -1, 1}, Vec3d{2, 0, -1}})
        EXPECT_TRUE(nearly_parallel(found[0], make_direction(expected), 1e-4) ||
                    nearly_parallel(found[1], make_direction(expected), 1e-4));
}

TEST(SplitSource, RandomDirectionsFillTheSphere) {
    const TriangleSet set = random_soup(5, 7);
    int majors[3] = {};
    for (std::uint64_t seed = 0; seed < 300; ++seed)
        for (const Direction &d : make_split_source(TreeKind::random)->directions(all_of(set), 4, Random(seed)))
            ++majors[d.major];
    for (const int count : majors)
        EXPECT_NEAR(count, 400, 60);
}

TEST(SplitSource, SameSeedSameDirections) {
    const TriangleSet set = random_soup(500, 8);
    for (const TreeKind tree : {TreeKind::random, TreeKind::normals, TreeKind::clustered}) {
        const auto source = make_split_source(tree);
        const auto once = source->directions(all_of(set), 6, Random(9)),
                   again = source->directions(all_of(set), 6, Random(9));
        EXPECT_EQ(once, again);
        EXPECT_EQ(once.size(), 6u);
        EXPECT_NE(once, source->directions(all_of(set), 6, Random(10)));
    }
}

} // namespace
