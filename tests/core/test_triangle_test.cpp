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
        for (unsigned lane = 0; lane < TriangleBlock::width; ++lane)
            block.set(lane, {random_point(random), random_point(random), random_point(random)}, lane);
        const Vec3f o = random_point(random, 3);
        Ray ray{o, block.triangle(0).a - o}; // a quarter aimed at a vertex, at an edge, along an axis, anywhere
        if (i % 4 == 1)
            ray.d = (block.triangle(1).a + block.triangle(1).b) * 0.5f - o;
        if (i % 4 == 2)
            ray.d = {0, i % 8 == 2 ? -0.0f : 0.0f, 1};
        if (i % 4 == 3)
            ray.d = random_point(random);
        const TypeParam test(ray);
        const unsigned candidates = test.candidates(block);
        for (unsigned lane = 0; lane < TriangleBlock::width; ++lane)
            if (test.intersect(block.triangle(lane))) {
                ++hits;
                EXPECT_TRUE(candidates >> lane & 1);
            }
    }
    EXPECT_GT(hits, 5000);
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
        EXPECT_TRUE(test.intersect({a, b, moved(0.5)}) || test.intersect({b, a, moved(-0.5)}));
    }
}

} // namespace
