#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "random.h"
#include "sorting.h"

using namespace bsp;

namespace {

TEST(Sorting, RadixSortEqualsTheStandardLibrary) {
    Random random(1);
    for (const std::size_t count : {0u, 1u, 2u, 1000u, 1024u, 5000u, 100000u}) {
        std::vector<float> values(count), scratch;
        for (float &value : values)
            value = float((random.uniform() - 0.5) * std::pow(10.0, 60 * random.uniform() - 30));
        for (std::size_t i = 0; i + 7 < count; i += 7)
            values[i] = i % 2 ? 0.0f : values[i + 3]; // equal values
        std::vector<float> expected = values;
        std::sort(expected.begin(), expected.end());
        sort_floats(values, scratch);
        EXPECT_EQ(values, expected) << count;
    }
}

TEST(Sorting, RoundingIsTheNearestFloatOnItsSide) {
    Random random(2);
    for (int i = 0; i < 100000; ++i) {
        const double x = (random.uniform() - 0.5) * std::pow(10.0, 80 * random.uniform() - 44);
        const float down = round_down(x), up = round_up(x);
        EXPECT_LE(double(down), x);
        EXPECT_GE(double(up), x);
        EXPECT_TRUE(down == up || std::nextafter(down, HUGE_VALF) == up) << x;
    }
    EXPECT_EQ(round_down(0.5), 0.5f);
    EXPECT_EQ(round_up(-0.5), -0.5f);
    EXPECT_EQ(round_up(1e-60), 0x1p-149f);
    EXPECT_EQ(round_down(-1e-60), -0x1p-149f);
}

} // namespace
