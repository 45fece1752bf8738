#include <gtest/gtest.h>

#include <cmath>

#include "accelerator.h"
#include "builder.h"
#include "hash.h"
#include "helpers.h"
#include "tree_file.h"

using namespace bsp;

namespace {

/// Spheres, intersected in double precision.
class Spheres : public Primitives {
public:
    struct Sphere {
        Vec3d centre;
        double radius;
    };
    std::vector<Sphere> spheres;

    float closest(std::uint32_t index, const Ray &ray) const noexcept override {
        const Sphere &s = spheres[index];
        const Vec3d o = to_double(ray.o) - s.centre, d = to_double(ray.d);
        const double a = dot(d, d), b = dot(o, d), c = dot(o, o) - s.radius * s.radius, root = b * b - a * c;
        if (!(root >= 0))
            return HUGE_VALF;
        for (const double sign : {-1.0, 1.0})
            if (const float t = float((-b + sign * std::sqrt(root)) / a); t >= 0 && t <= ray.maxt)
                return t;
        return HUGE_VALF;
    }

    void add_to(TriangleSet &set) const {
        for (const Sphere &s : spheres) {
            const double half = s.radius * 1.001;
            const Vec3d reach{half, half, half};
            set.add_primitive({s.centre - reach, s.centre + reach});
        }
    }
};

/// Their owner says anything: a hit before or behind the box, none, or no number.
class Liars final : public Spheres {
public:
    explicit Liars(const Spheres &spheres) : Spheres(spheres) {}

    float closest(std::uint32_t index, const Ray &ray) const noexcept override {
        Hash hash;
        hash.add(&index, sizeof index);
        hash.add(&ray, sizeof ray);
        Random random(hash.value());
        const double choice = random.uniform();
        return choice < 0.3 ? HUGE_VALF : choice < 0.4 ? NAN : float(8 * random.uniform() * random.uniform());
    }
};

Spheres random_spheres(std::size_t count, std::uint64_t seed, double radius, double scale = 1) {
    Random random(seed);
    Spheres found;
    for (std::size_t i = 0; i < count; ++i)
        found.spheres.push_back({to_double(random_point(random)) * scale, radius * scale * (0.2 + random.uniform())});
    return found;
}

std::vector<Settings> some_settings() {
    std::vector<Settings> all;
    for (const char *tree : {"auto", "kd", "rbsp", "random", "normals", "clustered"})
        all.push_back(make_settings(tree, {}));
    all.push_back(make_settings("auto", {{"expected_rays", "1e15"}}));
    for (const char *tree : {"kd", "normals", "rbsp"})
        all.push_back(make_settings(tree, {{"layout", "binary"}}));
    all.push_back(make_settings("normals", {{"axes", "none"}, {"weighting", "area"}}));
    all.push_back(make_settings("normals", {{"simd", "avx2"}, {"precision", "fast"}}));
    all.push_back(make_settings("clustered", {{"triangle_test", "mt"}, {"weighting", "area"}}));
    return all;
}

void expect_like_brute(const TriangleSet &set, const Spheres &spheres, const std::vector<Ray> &rays) {
    for (Settings settings : some_settings()) {
        SCOPED_TRACE(full_spec(settings));
        const BuildOptions options{"", nullptr, &spheres};
        const auto tree = make_accelerator(set, settings, options);
        EXPECT_EQ(tree->statistics().primitives, spheres.spheres.size());
        settings.tree = TreeKind::brute;
        const auto brute = make_accelerator(set, settings, options);
        std::size_t hits = 0;
        for (const Ray &ray : rays) {
            const Hit hit = tree->closest(ray), expected = brute->closest(ray);
            EXPECT_TRUE(same_bits(hit, expected));
            EXPECT_EQ(tree->any(ray), brute->any(ray));
            hits += is_primitive(hit.triangle);
        }
        EXPECT_GT(hits, rays.size() / 20) << "or this would show nothing";
    }
}

TEST(Primitives, AreHitAmongTriangles) {
    TriangleSet set = random_soup(300, 1);
    const Spheres spheres = random_spheres(40, 2, 0.2);
    const std::vector<Ray> rays = aimed_rays(set, 600, 3);
    spheres.add_to(set);
    EXPECT_EQ(validate(build_tree(set, make_settings("normals", {})), set), "");
    expect_like_brute(set, spheres, rays);
}

TEST(Primitives, AreTraversedSafelyWhateverIsAsked) {
    TriangleSet set = random_soup(50, 8);
    const Spheres spheres = random_spheres(10, 9, 0.2);
    spheres.add_to(set);
    const auto precision_of = [&](const Options &options) {
        return make_accelerator(set, make_settings("kd", options), {"", nullptr, &spheres})->statistics().precision;
    };
    for (const Options &options : std::vector<Options>{
             {{"precision", "fast"}}, {{"precision", "epsilon"}}, {{"precision", "auto"}}, {{"early_exit", "plane"}}})
        EXPECT_EQ(precision_of(options), "safe, for a tree of more than triangles has no other mode");
    EXPECT_EQ(precision_of({}), "");
}

TEST(Primitives, AreHitWithoutTriangles) {
    for (const double scale : {1.0, 1e-20, 1e12}) {
        const Spheres spheres = random_spheres(500, 4, 0.1, scale);
        TriangleSet set;
        spheres.add_to(set);
        Random random(5);
        std::vector<Ray> rays;
        for (int i = 0; i < 500; ++i) {
            const Vec3f from = random_point(random, 2), to = random_point(random, 0.5f);
            const float s = float(scale);
            rays.push_back({{from.x * s, from.y * s, from.z * s}, to - from});
        }
        expect_like_brute(set, spheres, rays);
    }
}

TEST(Primitives, AreHitFromAfar) {
    const Spheres spheres = random_spheres(200, 6, 0.01);
    TriangleSet set;
    spheres.add_to(set);
    Random random(7);
    std::vector<Ray> rays;
    for (const float distance : {30.0f, 1e3f, 1e5f, 1e7f})
        for (int i = 0; i < 300; ++i) {
            const Spheres::Sphere &s = spheres.spheres[std::size_t(i) % spheres.spheres.size()];
            Vec3f d = random_point(random);
            d[std::size_t(i) % 3] *= i % 2 ? 1.0f : 1e-4f;
            const Vec3f target = random_point(random);
            const float radius = float(s.radius);
            rays.push_back({{float(s.centre.x) + radius * target.x - distance * d.x,
                             float(s.centre.y) + radius * target.y - distance * d.y,
                             float(s.centre.z) + radius * target.z - distance * d.z},
                            d});
        }
    expect_like_brute(set, spheres, rays);
}

TEST(Primitives, AreTheSameInEveryTreeWhateverTheirOwnerSays) {
    TriangleSet set = random_soup(50, 8);
    const Liars liars(random_spheres(150, 9, 0.1));
    const std::vector<Ray> rays = aimed_rays(set, 500, 10);
    liars.add_to(set);
    expect_like_brute(set, liars, rays);
}

TEST(Primitives, AHitOutsideTheBoxIsMovedIntoIt) {
    class Fixed final : public Primitives {
    public:
        float t = 0;
        float closest(std::uint32_t, const Ray &) const noexcept override { return t; }
    } owner;
    TriangleSet set;
    set.add_primitive({{-1, -1, -1}, {1, 1, 1}});
    for (const char *name : {"kd", "brute"}) {
        const auto tree = make_accelerator(set, make_settings(name, {}), {"", nullptr, &owner});
        const auto t_of = [&](float t, const Ray &ray) {
            owner.t = t;
            return tree->closest(ray).t;
        };
        EXPECT_EQ(t_of(2.5f, {{-3, 0, 0}, {1, 0, 0}}), 2.5f);
        EXPECT_NEAR(t_of(0.5f, {{-3, 0, 0}, {1, 0, 0}}), 2, 1e-5);
        EXPECT_NEAR(t_of(50, {{-3, 0, 0}, {1, 0, 0}}), 4, 1e-5);
        EXPECT_EQ(t_of(0.5f, {{-3, 2, 0}, {1, 0, 0}}), HUGE_VALF) << "beside it";
        EXPECT_EQ(t_of(0.5f, {{-3, 0, 0}, {1, 0, 0}, 1}), HUGE_VALF) << "the box is beyond the end of the ray";
    }
}

TEST(Primitives, TheIntervalOfARayHoldsForThemToo) {
    Spheres spheres;
    spheres.spheres.push_back({{0, 0, 0}, 1});
    TriangleSet set;
    spheres.add_to(set);
    const auto tree = make_accelerator(set, make_settings("kd", {}), {"", nullptr, &spheres});
    const auto hit = [&](Ray ray) { return tree->closest(ray); };
    EXPECT_EQ(hit({{-3, 0, 0}, {1, 0, 0}}).t, 2);
    EXPECT_EQ(hit({{-3, 0, 0}, {1, 0, 0}}).triangle, primitive_id(0));
    EXPECT_EQ(hit({{-3, 0, 0}, {1, 0, 0}, 2}).t, 2) << "closed at its end";
    EXPECT_FALSE(hit({{-3, 0, 0}, {1, 0, 0}, 1.9f}).found());
    EXPECT_EQ(hit({{0, 0, 0}, {1, 0, 0}}).t, 1) << "from inside, its far side";
    EXPECT_FALSE(hit({{3, 0, 0}, {1, 0, 0}}).found());
    EXPECT_FALSE(tree->any({{-3, 0, 0}, {1, 0, 0}, 1.9f}));
    EXPECT_TRUE(tree->any({{-3, 0, 0}, {1, 0, 0}, 2}));
}

TEST(Primitives, OfEqualHitsATriangleIsFirstThenTheSmallestNumber) {
    Spheres spheres;
    spheres.spheres.push_back({{0, 0, 0}, 1});
    spheres.spheres.push_back({{0, 0, 0}, 1});
    TriangleSet set;
    spheres.add_to(set);
    const Ray ray{{-3, 0, 0}, {1, 0, 0}};
    const BuildOptions options{"", nullptr, &spheres};
    EXPECT_EQ(make_accelerator(set, make_settings("kd", {}), options)->closest(ray).triangle, primitive_id(0));
    TriangleSet both = make_set({{{-1, -1, -1}, {-1, 3, -1}, {-1, -1, 3}}});
    spheres.add_to(both);
    for (const char *tree : {"kd", "normals", "brute"})
        EXPECT_EQ(make_accelerator(both, make_settings(tree, {}), options)->closest(ray).triangle, 0u) << tree;
}

TEST(Primitives, SomeAreRefused) {
    Spheres spheres = random_spheres(3, 1, 0.5);
    TriangleSet set;
    spheres.add_to(set);
    EXPECT_THROW(make_accelerator(set, make_settings("ize", {}), {"", nullptr, &spheres}), std::invalid_argument);
}

} // namespace
