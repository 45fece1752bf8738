#include <gtest/gtest.h>

#include "helpers.h"
#include "triangle_test.h"

using namespace bsp;

namespace {

template <typename Test> class TriangleTests : public ::testing::Test {};
using BothTests = ::testing::Types<WoopTest, MtTest>;
TYPED_TEST_SUITE(TriangleTests, BothTests);

const Triangle unit{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};

TYPED_TEST(TriangleTests, ByHand) {
    const auto hit = TypeParam(Ray{{0.25f, 0.5f, 2}, {0, 0, -1}}).intersect(unit);
    ASSERT_TRUE(hit);
    EXPECT_EQ(hit->t, 2.0f);
    EXPECT_EQ(hit->u, 0.25f);
    EXPECT_EQ(hit->v, 0.5f);
    EXPECT_FALSE(TypeParam(Ray{{0.75f, 0.5f, 2}, {0, 0, -1}}).intersect(unit));
    EXPECT_TRUE(TypeParam(Ray{{0.25f, 0.5f, -2}, {0, 0, 4}}).intersect(unit)) << "from the back";
    EXPECT_FALSE(TypeParam(Ray{{0.25f, -1, 0}, {0, 1, 0}}).intersect(unit)) << "in the plane";
}

TYPED_TEST(TriangleTests, CandidatesHoldEveryHit) {
    Random random(20);
    int hits = 0;
    for (int i = 0; i < 20000; ++i) {
        TriangleBlock block;
        Triangle triangles[TriangleBlock::width];
        for (unsigned lane = 0; lane < TriangleBlock::width; ++lane) {
            triangles[lane] = {random_point(random), random_point(random), random_point(random)};
            block.set(lane, triangles[lane], lane);
        }
        const Vec3f o = random_point(random, 3);
        Ray ray{o, triangles[0].a - o}; // a quarter aimed at a vertex, at an edge, along an axis, anywhere
        if (i % 4 == 1)
            ray.d = (triangles[1].a + triangles[1].b) * 0.5f - o;
        if (i % 4 == 2)
            ray.d = {0, i % 8 == 2 ? -0.0f : 0.0f, 1};
        if (i % 4 == 3)
            ray.d = random_point(random);
        const TypeParam test(ray);
        for (unsigned lane = 0; lane < TriangleBlock::width; ++lane)
            if (const auto hit = test.intersect(triangles[lane]); hit && hit->t >= 0) {
                ++hits;
                EXPECT_TRUE(test.candidates(block, hit->t, no_triangle) >> lane & 1) << "a limit that it just meets";
                EXPECT_TRUE(test.candidates(block, HUGE_VALF, no_triangle) >> lane & 1);
                const auto same = test.intersect(TriangleBlock::Lane{block, lane});
                ASSERT_TRUE(same);
                EXPECT_EQ(same->t, hit->t);
            }
    }
    EXPECT_GT(hits, 5000);
}

TYPED_TEST(TriangleTests, CandidatesLieWithinTheLimit) {
    TriangleBlock block;
    for (unsigned lane = 0; lane < TriangleBlock::width; ++lane) { // one behind the other, the last lane not used
        const float z = float(lane);
        block.set(lane, {{0, 0, z}, {1, 0, z}, {0, 1, z}}, lane < 7 ? lane : no_triangle);
    }
    EXPECT_EQ(TypeParam(Ray{{0.25f, 0.25f, -1}, {0, 0, 1}}).candidates(block, HUGE_VALF, 5), 0b01011111u);
    EXPECT_EQ(TypeParam(Ray{{0.25f, 0.25f, 1.5f}, {0, 0, 1}}).candidates(block, 3, no_triangle), 0b00011100u);
    EXPECT_EQ(TypeParam(Ray{{0.25f, 0.25f, 4.5f}, {0, 0, -2}}).candidates(block, 1.5f, no_triangle), 0b00011100u);
}

/// Edge functions of neighbours are exact negatives: a ray at their common edge hits at least one of them. (A
/// vertex needs a whole fan: the closed meshes of the Python tests have them.)
TEST(WoopTest, NoRayPassesBetweenNeighbours) {
    Random random(21);
    for (int i = 0; i < 100000; ++i) {
        const Vec3f a = random_point(random), b = random_point(random), o = random_point(random, 3);
        const Vec3f target = a + (b - a) * float(random.uniform());
        // Wings to both sides of the edge, as seen from the ray.
        const Vec3d d = to_double(target) - to_double(o), side = cross(d, to_double(b) - to_double(a));
        const Vec3d wing = side * (1 / norm(side));
        const auto moved = [&](double by) {
            const Vec3d p = to_double(a) + (to_double(b) - to_double(a)) * 0.5 + wing * by;
            return Vec3f{float(p.x), float(p.y), float(p.z)};
        };
        const WoopTest test(Ray{o, target - o});
        EXPECT_TRUE(test.intersect(Triangle{a, b, moved(0.5)}) || test.intersect(Triangle{b, a, moved(-0.5)}));
    }
}

} // namespace
