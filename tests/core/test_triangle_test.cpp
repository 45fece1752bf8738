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
    EXPECT_EQ(hit.t(), 2.0f);
    EXPECT_EQ(hit.u(), 0.25f);
    EXPECT_EQ(hit.v(), 0.5f);
    EXPECT_EQ(TypeParam(Ray{{0.25f, 0.5f, -2}, {0, 0, -1}}).intersect(unit).t(), -2.0f) << "behind";
    EXPECT_FALSE(TypeParam(Ray{{0.75f, 0.5f, 2}, {0, 0, -1}}).intersect(unit).found());
    EXPECT_TRUE(TypeParam(Ray{{0.25f, 0.5f, -2}, {0, 0, 4}}).intersect(unit).found()) << "from the back";
    EXPECT_FALSE(TypeParam(Ray{{0.25f, -1, 0}, {0, 1, 0}}).intersect(unit).found()) << "in the plane";
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
            if (const auto hit = test.intersect(triangles[lane]); hit.t() >= 0) {
                ++hits;
                EXPECT_TRUE(test.candidates(block) >> lane & 1);
                EXPECT_EQ(test.intersect(TriangleBlock::Lane{block, lane}).t(), hit.t());
            }
    }
    EXPECT_GT(hits, 5000);
}

TYPED_TEST(TriangleTests, UnusedLanesAreNoCandidates) {
    TriangleBlock block;
    EXPECT_EQ(block.triangle_count(), 0u);
    for (unsigned lane : {0u, 2u, 3u, 6u}) // one behind the other
        block.set(lane, {{0, 0, float(lane)}, {1, 0, float(lane)}, {0, 1, float(lane)}}, lane);
    EXPECT_EQ(block.triangle_count(), 4u);
    EXPECT_EQ(TypeParam(Ray{{0.25f, 0.25f, -1}, {0, 0, 1}}).candidates(block), 0b01001101u);
    EXPECT_EQ(TypeParam(Ray{{-0.25f, 0.25f, -1}, {0, 0, 1}}).candidates(block), 0u);
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
        EXPECT_TRUE(test.intersect(Triangle{a, b, moved(0.5)}).found() ||
                    test.intersect(Triangle{b, a, moved(-0.5)}).found());
    }
}

} // namespace
