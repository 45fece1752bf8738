#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "helpers.h"

using namespace bsp;

namespace {

const Triangle good{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};

TEST(Triangles, InvalidOnesKeepTheirIdsAndAreLeftOut) {
    const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
    const TriangleSet set = make_set({good,
                                      {{nan, 0, 0}, {1, 0, 0}, {0, 1, 0}},
                                      {{0, 0, 0}, {1, inf, 0}, {0, 1, 0}},
                                      {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}},
                                      {{3, 3, 3}, {3, 3, 3}, {4, 4, 4}},
                                      {{0, 0, 1e30f}, {1e30f, 0, 0}, {0, 1e30f, 0}},
                                      {{0, 0, 0}, {1e-40f, 0, 0}, {0, 1e-40f, 0}}});
    EXPECT_EQ(set.valid, (std::vector<std::uint32_t>{0, 5, 6}));
    EXPECT_EQ(set.dropped(), 4u);
    EXPECT_EQ(set.bounds.upper, (Vec3d{double(1e30f), double(1e30f), double(1e30f)}));
}

TEST(Triangles, IndexOutOfRangeNamesItselfAndAddsNothing) {
    const float vertices[9] = {};
    const std::uint32_t faces[6] = {0, 1, 2, 0, 1, 3};
    TriangleSet set;
    try {
        set.add(vertices, 3, faces, 2);
        FAIL();
    } catch (const std::out_of_range &error) {
        EXPECT_STREQ(error.what(), "triangle 1 refers to vertex 3, but the mesh has 3 vertices");
    }
    EXPECT_TRUE(set.triangles.empty());
}

TEST(Triangles, MeshesAreNumberedOneAfterTheOther) {
    TriangleSet set = make_set({good, good});
    const float vertices[9] = {0, 0, 5, 1, 0, 5, 0, 1, 5};
    const std::uint32_t face[3] = {0, 1, 2};
    set.add(vertices, 3, face, 1);
    EXPECT_EQ(set.valid, (std::vector<std::uint32_t>{0, 1, 2}));
    EXPECT_EQ(set.triangles[2].a, (Vec3f{0, 0, 5}));
}

} // namespace
