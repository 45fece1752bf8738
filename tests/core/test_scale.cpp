#include <gtest/gtest.h>

#include <pmmintrin.h>

#include <cstring>

#include "helpers.h"

using namespace bsp;

namespace {

constexpr float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();

std::vector<Settings> some_settings() {
    std::vector<Settings> all;
    for (const char *tree : {"kd", "normals", "ize"})
        for (const char *layout : {"binary", "wide"})
            all.push_back(make_settings(tree, {{"layout", layout}}));
    all.push_back(make_settings("brute", {}));
    return all;
}

TriangleSet scaled(const TriangleSet &set, float factor) {
    std::vector<Triangle> triangles;
    for (const Triangle &t : set.triangles)
        triangles.push_back({t.a * factor, t.b * factor, t.c * factor});
    return make_set(triangles);
}

/// As in a thread of the renderer.
class FlushedFloats {
public:
    FlushedFloats() : m_saved(_mm_getcsr()) {
        _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
        _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
    }
    ~FlushedFloats() { _mm_setcsr(m_saved); }

private:
    unsigned m_saved;
};

std::string bytes_of(const Accelerator &accelerator) {
    std::string bytes;
    for (const MemoryPart &part : accelerator.memory())
        bytes.append(static_cast<const char *>(part.data), part.size);
    return bytes;
}

/// Rays that begin so near to a triangle, or are so long, that t may be rounded to 0 or to -0, which are hits.
TEST(Scale, HitsAtNearlyZeroAreThoseOfBruteForce) {
    std::vector<Triangle> triangles = random_soup(40, 46).triangles;
    triangles.push_back({{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}});
    const TriangleSet set = make_set(triangles);
    std::size_t hits = 0;
    for (const Settings &settings : some_settings()) {
        const auto tree = make_accelerator(set, settings), brute = make_accelerator(set, make_settings("brute", {}));
        for (const bool flushes : {false, true})
            for (int length = -60; length <= 60; length += 10)
                for (int height = -126; height <= -20; height += 3)
                    for (const float side : {-1.f, 1.f}) {
                        const Ray ray{{0.01f, 0.02f, side * std::ldexp(1.f, height)}, {0, 0, std::ldexp(1.f, length)}};
                        std::optional<FlushedFloats> floats;
                        if (flushes)
                            floats.emplace();
                        const Hit hit = tree->closest(ray), expected = brute->closest(ray);
                        const bool any = tree->any(ray);
                        floats.reset();
                        EXPECT_TRUE(same_bits(hit, expected))
                            << full_spec(settings) << ", 2^" << height << " off, 2^" << length << " long";
                        EXPECT_EQ(any, expected.found());
                        hits += expected.triangle == 40;
                    }
    }
    EXPECT_GT(hits, 1000u);
}

TEST(Scale, ScenesTimesAPowerOfTwoAreTheSame) {
    const TriangleSet set = random_soup(300, 40);
    const std::vector<Ray> rays = aimed_rays(set, 500, 41);
    for (const Settings &settings : some_settings()) {
        const auto tree = make_accelerator(set, settings);
        for (const int k : {-100, -60, -20, -1, 1, 20, 60, 100}) {
            const float factor = std::ldexp(1.0f, k);
            const auto other = make_accelerator(scaled(set, factor), settings);
            EXPECT_EQ(bytes_of(*other), bytes_of(*tree)) << full_spec(settings) << ", 2^" << k;
            EXPECT_EQ(other->planes().size(), tree->planes().size());
            for (std::size_t i = 0; i < tree->planes().size(); ++i)
                ASSERT_EQ(other->planes()[i].offset, tree->planes()[i].offset * factor);
            for (const Ray &ray : rays) {
                const Hit hit = tree->closest(ray);
                Hit found = other->closest({ray.o * factor, ray.d, ray.maxt});
                found.t /= factor;
                ASSERT_TRUE(same_bits(hit, found)) << full_spec(settings) << ", 2^" << k;
                ASSERT_TRUE(same_bits(hit, other->closest({ray.o * factor, ray.d * factor, ray.maxt})));
                ASSERT_EQ(other->any({ray.o * factor, ray.d}), hit.found());
                if (!hit.found())
                    continue;
                const float t = hit.t * factor;
                ASSERT_TRUE(other->any({ray.o * factor, ray.d, t})) << "the interval has its end";
                ASSERT_EQ(other->closest({ray.o * factor, ray.d, t}).t, t);
                ASSERT_NE(other->closest({ray.o * factor, ray.d, std::nextafter(t, 0.0f)}).t, t);
            }
        }
    }
}

TEST(Scale, LengthsOfDirectionsDoNotMatter) {
    const TriangleSet set = random_soup(300, 42);
    const std::vector<Ray> rays = aimed_rays(set, 500, 43);
    for (const Settings &settings : some_settings()) {
        const auto tree = make_accelerator(set, settings);
        for (const int k : {-110, -70, -59, -20, 20, 61, 100})
            for (const Ray &ray : rays) {
                const Ray other{ray.o, ray.d * std::ldexp(1.0f, k), ray.maxt};
                Hit hit = tree->closest(other);
                hit.t = std::ldexp(hit.t, k);
                ASSERT_TRUE(same_bits(hit, tree->closest(ray))) << full_spec(settings) << ", 2^" << k;
                ASSERT_EQ(tree->any(other), hit.found());
            }
    }
}

TEST(Scale, TheSmallestNumbersDoInEveryThread) {
    const Triangle t{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    for (const Settings &settings : some_settings()) {
        const auto usual = make_accelerator(make_set({t}), settings);
        for (const bool flushed : {false, true}) {
            std::optional<FlushedFloats> floats;
            if (flushed)
                floats.emplace();
            const Hit hit = usual->closest({{0.25f, 0.5f, 1}, {0, 0, -0x1p-140f}});
            EXPECT_TRUE(!hit.found()) << "t is more than any number";
            EXPECT_EQ(usual->closest({{0.25f, 0.5f, 0x1p-20f}, {0, 0, -0x1p-140f}}).t, 0x1p120f);
            EXPECT_EQ(usual->closest({{0.25f, 0.5f, 1}, {0, 0, -0x1p120f}}).t, 0x1p-120f);
            EXPECT_FALSE(usual->any({{0.25f, 0.5f, 1}, {0, 0, -0x1p-140f}}));
            // Written out, for the product of a number that is flushed is 0 here.
            const auto tiny = make_accelerator(make_set({{{0, 0, 0}, {0x1p-130f, 0, 0}, {0, 0x1p-130f, 0}}}), settings);
            EXPECT_EQ(tiny->statistics().triangles, 1u);
            EXPECT_EQ(tiny->closest({{0x1p-132f, 0x1p-131f, 0x1p-120f}, {0, 0, -1}}).t, 0x1p-120f);
            EXPECT_EQ(tiny->closest({{0x1p-132f, 0x1p-131f, 0x1p-130f}, {0, 0, -0x1p-130f}}).t, 1);
        }
    }
}

TEST(Scale, HugeNumbersMissOrHitButAreNeverWrong) {
    const float s = 3e38f;
    const TriangleSet set = make_set({{{-s, -s, 0}, {s, -s, 0}, {0, s, 0}}, {{-s, -s, s}, {s, -s, s}, {0, s, s}}});
    for (const Settings &settings : some_settings()) {
        const auto tree = make_accelerator(set, settings);
        EXPECT_EQ(tree->closest({{0, 0, 1e30f}, {0, 0, -1}}).t, 1e30f);
        EXPECT_EQ(tree->closest({{0, 0, 1e30f}, {0, 0, 1e30f}}).triangle, 1u);
        const Ray slow{{0, 0, 1e38f}, {0, 0, 0.1f}}; // would arrive at t = 2e39
        EXPECT_FALSE(tree->closest(slow).found() || tree->any(slow));
        EXPECT_EQ(tree->closest(slow).t, inf);
    }
}

TEST(Scale, IntervalsOfEveryKind) {
    const TriangleSet set = make_set({{{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}}});
    for (const Settings &settings : some_settings()) {
        const auto tree = make_accelerator(set, settings);
        for (const float maxt : {nan, -nan, -1.f, -inf, -0x1p-149f}) {
            EXPECT_FALSE(tree->any({{0, 0, 0}, {0, 0, 1}, maxt})) << maxt;
            EXPECT_FALSE(tree->closest({{0, 0, 0}, {0, 0, 1}, maxt}).found()) << maxt;
        }
        for (const float maxt : {0.f, -0.f, 0x1p-149f}) {
            EXPECT_TRUE(tree->any({{0, 0, 0}, {0, 0, 1}, maxt})) << maxt;
            EXPECT_FALSE(tree->any({{0, 0, -1}, {0, 0, 1}, maxt})) << maxt;
        }
        EXPECT_TRUE(tree->any({{0, 0, 0x1p-149f}, {0, 0, -1}, 0x1p-149f}));
        EXPECT_TRUE(tree->any({{0, 0, -1}, {0, 0, 1}, inf}));
        EXPECT_FALSE(tree->any({{0, 0, -0x1p100f}, {0, 0, 1}, inf})) << "too far away";
        EXPECT_TRUE(tree->any({{0, 0, -0x1p95f}, {0, 0, 1}, inf}));
    }
}

TEST(Scale, EndsAreNotRoundedUpInAHugeScene) {
    const float far = 0x1p126f; // the scale makes 1 the smallest normal number, and what is below it denormal
    const TriangleSet set =
        make_set({{{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}}, {{far, 0, 0}, {far, far, 0}, {far, 0, far}}});
    for (const Settings &settings : some_settings()) {
        const auto tree = make_accelerator(set, settings);
        const Ray short_of_it{{0, 0, 1}, {0, 0, -1}, std::nextafter(1.0f, 0.0f)};
        EXPECT_FALSE(tree->any(short_of_it)) << full_spec(settings);
        EXPECT_FALSE(tree->closest(short_of_it).found()) << full_spec(settings);
        EXPECT_TRUE(tree->any({{0, 0, 1}, {0, 0, -1}, 1})) << full_spec(settings);
        EXPECT_EQ(tree->closest({{0, 0, 1}, {0, 0, -1}, 1}).t, 1) << full_spec(settings);
    }
}

} // namespace
