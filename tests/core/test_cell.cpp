#include <gtest/gtest.h>

#include "cell.h"
#include "random.h"

using namespace bsp;

namespace {

const Bounds box{{-1, -2, -0.5}, {1, 3, 0.7}};

Direction random_direction(Random &random) {
    if (random.below(4) == 0)
        return {std::uint8_t(random.below(3)), 0, 0};
    return make_direction({random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5});
}

TEST(Cell, BoxAreasByHand) {
    const Cell cell(box);
    EXPECT_DOUBLE_EQ(cell.area(), 2 * (2 * 5 + 5 * 1.2 + 1.2 * 2));
    const Direction y{1, 0, 0};
    AreaProfile profile;
    profile.reset(cell, y);
    EXPECT_EQ(profile.lower(), -2);
    EXPECT_EQ(profile.upper(), 3);
    const auto [below, above] = profile.at(0);
    EXPECT_DOUBLE_EQ(below, 2 * (2 * 2 + 2 * 1.2 + 1.2 * 2));
    EXPECT_DOUBLE_EQ(above, 2 * (2 * 3 + 3 * 1.2 + 1.2 * 2));
}

TEST(Cell, CornerOfACubeByHand) {
    // The plane x + y + z = 0.5 cuts a corner off the unit cube: three right triangles and an equilateral one.
    const Cell cell(Bounds{{0, 0, 0}, {1, 1, 1}});
    const Direction diagonal = make_direction({1, 1, 1});
    const double corner = 3 * 0.125 + std::sqrt(3.0) / 4 * 0.5, rest = 6 - 3 * 0.125 + std::sqrt(3.0) / 4 * 0.5;
    AreaProfile profile;
    profile.reset(cell, diagonal);
    const auto [below, above] = profile.at(0.5);
    EXPECT_NEAR(below, corner, 1e-12);
    EXPECT_NEAR(above, rest, 1e-12);
    const auto parts = cell.split(diagonal, 0.5);
    ASSERT_TRUE(parts);
    EXPECT_NEAR(parts->first.area(), corner, 1e-12);
    EXPECT_NEAR(parts->second.area(), rest, 1e-12);
    EXPECT_EQ(parts->first.polyhedron().face_count(), 4u);
    EXPECT_EQ(parts->second.polyhedron().face_count(), 7u);
}

TEST(Cell, PlanesOutsideOrOnTheSurfaceDoNotSplit) {
    const Cell cell(box);
    for (const double offset : {-1.0, 1.0, 1.5})
        EXPECT_FALSE(cell.split({0, 0, 0}, offset));
    const Direction d = make_direction({1, 2, 3});
    const auto [low, high] = cell.extent(d);
    EXPECT_FALSE(cell.split(d, low));
    EXPECT_FALSE(cell.split(d, high + 1));
    EXPECT_TRUE(cell.split(d, (low + high) / 2));
}

/// What the sweep believes of a plane is what clipping makes of it, down to the smallest cells.
TEST(Cell, ProfileEqualsClipping) {
    Random random(1);
    int cuts = 0;
    for (int trial = 0; trial < 200; ++trial) {
        Cell cell(box);
        for (int depth = 0; depth < 25; ++depth) {
            const Direction direction = random_direction(random);
            const auto [low, high] = cell.extent(direction);
            AreaProfile profile;
            profile.reset(cell, direction);
            EXPECT_NEAR(profile.lower(), low, 1e-12);
            EXPECT_NEAR(profile.upper(), high, 1e-12);
            std::optional<std::pair<Cell, Cell>> next;
            for (int i = 1; i < 8; ++i) {
                const double offset = low + (high - low) * i / 8;
                const auto [below, above] = profile.at(offset);
                const auto parts = cell.split(direction, offset);
                if (!parts)
                    continue;
                ++cuts;
                EXPECT_NEAR(parts->first.area(), below, 1e-10 * cell.area());
                EXPECT_NEAR(parts->second.area(), above, 1e-10 * cell.area());
                if (i == 4)
                    next = parts;
            }
            if (!next)
                break;
            cell = random.below(2) ? next->first : next->second;
        }
    }
    EXPECT_GT(cuts, 20000);
}

} // namespace
