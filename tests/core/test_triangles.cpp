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

TEST(Triangles, AreaIsDecidedExactly) {
    const Vec3f v{1 + 0x1p-22f, 0.7f, -1.3f};
    const std::vector<Triangle> flat = {
        {v, v * 2, v * 4}, {v, v, v * 4}, {{-7, 0.1f, 0}, {0, 0.1f, 0}, {0x1p-40f, 0.1f, 0}}};
    // One of the sides is 2^80 times shorter than the others, then seen at an angle of 2^-80.
    const std::vector<Triangle> thin = {{{0, 0, 0}, {1, 1, 0}, {0x1p-80f, 0, 0}},
                                        {{1, 1, 0}, {3, 3, 0}, {0, 0x1p-80f, 0}},
                                        {{0.1f, 0.1f, 0x1p-100f}, {0.3f, 0.3f, 0}, {0.7f, 0.7f, 0}}};
    for (const float scale : {0x1p-20f, 1.f, 0x1p90f}) {
        const auto scaled = [&](const Triangle &t) { return Triangle{t.a * scale, t.b * scale, t.c * scale}; };
        for (const Triangle &t : flat)
            EXPECT_EQ(make_set({scaled(t)}).dropped(), 1u) << scale;
        for (const Triangle &t : thin)
            EXPECT_EQ(make_set({scaled(t)}).dropped(), 0u) << scale;
    }
}

double digits_of(double x) {
    int exponent;
    return std::frexp(x, &exponent);
}

TEST(Triangles, AreRescaledByAPowerOfTwo) {
    for (const float size : {1.f, 0.75f, 3.f, 1e30f, 3.4e38f, 1e-30f, 1e-40f, 0x1p-149f}) {
        TriangleSet set = make_set({{{-size, 0, 0}, {0, size, 0}, {0, 0, size}}});
        const Bounds before = set.bounds;
        set.rescale();
        const double largest = -set.bounds.lower.x;
        EXPECT_EQ(digits_of(largest), digits_of(double(size))) << "the same digits";
        EXPECT_LT(largest, size > 0x1p126f ? 4 : 1) << size;
        EXPECT_GE(largest, size > 0x1p-127f ? 0.5 : size * 0x1p126) << size;
        EXPECT_EQ(set.user_bounds().lower, before.lower);
        EXPECT_EQ(set.user_bounds().upper, before.upper);
    }
    TriangleSet none;
    none.rescale();
    EXPECT_TRUE(none.user_bounds().empty());
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
