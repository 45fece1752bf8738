#include <gtest/gtest.h>

#include "builder.h"
#include "helpers.h"
#include "orientation.h"

using namespace bsp;

namespace {

std::vector<Settings> turned_settings() {
    std::vector<Settings> all;
    for (const char *tree : {"kd", "rbsp", "ize", "random", "normals", "clustered"})
        for (const char *layout : {"binary", "wide"})
            all.push_back(make_settings(tree, {{"orientation", "scene"}, {"layout", layout}}));
    all.push_back(make_settings("normals", {{"orientation", "scene"}, {"axes", "none"}, {"simd", "avx2"}}));
    all.push_back(make_settings("rbsp", {{"orientation", "scene"}, {"layout", "binary"}, {"cached_dots", "false"}}));
    return all;
}

TriangleSet moved(const TriangleSet &set, float size, const Vec3f &by) {
    std::vector<Triangle> triangles;
    for (const Triangle &t : set.triangles)
        triangles.push_back({t.a * size + by, t.b * size + by, t.c * size + by});
    return make_set(triangles);
}

/// At vertices and at points of edges, from near and from far, and along the axes.
std::vector<Ray> hard_rays(const TriangleSet &set, std::size_t count, std::uint64_t seed) {
    Random random(seed);
    std::vector<Ray> rays;
    const Vec3d size = set.bounds.upper - set.bounds.lower, middle = (set.bounds.upper + set.bounds.lower) * 0.5;
    const float reach = float(std::max({size.x, size.y, size.z}));
    const Vec3f centre{float(middle.x), float(middle.y), float(middle.z)};
    for (std::size_t i = 0; i < count; ++i) {
        const float away = i % 7 == 0 ? 1000 * reach : reach;
        const Vec3f o = centre + random_point(random, away);
        const Triangle &t = set.triangles[random.below(std::uint32_t(set.triangles.size()))];
        const float along = float(random.uniform());
        const Vec3f target = i % 2 ? t.a : t.a * along + t.b * (1 - along);
        rays.push_back({o, target - o});
        if (i % 5 == 0) {
            Vec3f d{0, 0, 0};
            d[i % 3] = i % 2 ? 1.0f : -1.0f;
            rays.push_back({target - d * reach, d});
        }
    }
    return rays;
}

void expect_like_brute(const TriangleSet &set, std::size_t rays, std::uint64_t seed) {
    ASSERT_TRUE(find_orientation(set).turns()) << "or this would show nothing";
    const auto brute = make_accelerator(set, make_settings("brute", {}));
    const std::vector<Ray> asked = hard_rays(set, rays, seed);
    for (const Settings &settings : turned_settings()) {
        SCOPED_TRACE(full_spec(settings));
        EXPECT_EQ(validate(build_tree(set, settings), set), "");
        const auto tree = make_accelerator(set, settings);
        for (const Ray &ray : asked) {
            EXPECT_TRUE(same_bits(tree->closest(ray), brute->closest(ray)));
            EXPECT_EQ(tree->any(ray), brute->any(ray));
        }
    }
}

TEST(Orientation, IsThatOfTurnedBoxes) {
    for (const float angle : {0.1f, 0.5f, 0.7853982f, 1.0f}) {
        const TriangleSet set = grid_of_boxes(6, angle);
        EXPECT_LT(axis_share(set), 0.1);
        const Orientation found = find_orientation(set);
        EXPECT_TRUE(found.turns());
        EXPECT_NEAR(axis_share(set, found), 1, 1e-9) << angle;
        EXPECT_NEAR(axis_share(found.seen(set)), 1, 1e-9);
        const auto axes = found.axes();
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t j = 0; j < 3; ++j)
                EXPECT_NEAR(dot(axes[i], axes[j]), i == j, 1e-14);
        const Bounds bounds = found.seen(set).bounds;
        for (std::size_t k = 0; k < 3; ++k)
            EXPECT_NEAR(bounds.lower[k], -bounds.upper[k], 1e-5) << "seen from the middle";
    }
}

TEST(Orientation, IsTheUsersWhereNothingIsGained) {
    EXPECT_FALSE(find_orientation(TriangleSet{}).turns());
    EXPECT_FALSE(find_orientation(grid_of_boxes(4, 0)).turns());
    EXPECT_FALSE(find_orientation(make_set({Triangle{}})).turns());
    const Vec3d point{1, 2, 3};
    EXPECT_EQ(Orientation().seen(point), point);
}

TEST(Orientation, OfOneWallIsAlongItsEdge) {
    const Vec3f edge{3, 1, 2}, other{-0.2f, 0.5f, 0.1f};
    const TriangleSet wall = make_set({{{0, 0, 0}, edge, edge * 0.5f + other}});
    const Orientation found = find_orientation(wall);
    ASSERT_TRUE(found.turns());
    const Vec3d seen = found.seen(to_double(edge)) - found.seen(Vec3d{0, 0, 0});
    EXPECT_NEAR(std::max({std::abs(seen.x), std::abs(seen.y), std::abs(seen.z)}), std::sqrt(14.0), 1e-12);
}

TEST(Orientation, ChangesNoAnswer) {
    expect_like_brute(random_soup(1, 5), 200, 1);
    expect_like_brute(random_soup(300, 2), 600, 3);
    expect_like_brute(grid_of_boxes(4, 0.4f), 600, 4);
    expect_like_brute(grids_askew(3), 200, 5);
}

TEST(Orientation, ChangesNoAnswerFarFromTheOriginOrAtAnySize) {
    const TriangleSet boxes = grid_of_boxes(3, 0.4f);
    expect_like_brute(moved(boxes, 1, {1e3f, -2e3f, 5e2f}), 400, 6);
    expect_like_brute(moved(boxes, 1, {148376, 1234, -223423}), 400, 7);
    expect_like_brute(moved(boxes, 1e-20f, {0, 0, 0}), 300, 8);
    expect_like_brute(moved(boxes, 1e20f, {3e21f, 0, 0}), 300, 9);
}

/// Of a triangle's own box.
class Boxes final : public Primitives {
public:
    float closest(std::uint32_t, const Ray &) const noexcept override { return 1; }
};

TEST(Orientation, HoldsForPrimitivesToo) {
    TriangleSet set = grid_of_boxes(3, 0.4f);
    const std::vector<Ray> rays = hard_rays(set, 500, 10);
    Random random(11);
    for (int i = 0; i < 50; ++i) {
        const Vec3d at = to_double(random_point(random, 2));
        set.add_primitive({at, at + Vec3d{1, 0.3, 0.5}});
    }
    const Boxes owner;
    const BuildOptions options{"", nullptr, &owner};
    const auto brute = make_accelerator(set, make_settings("brute", {}), options);
    std::size_t hits = 0;
    for (const char *tree : {"kd", "normals", "rbsp"}) {
        const auto turned = make_accelerator(set, make_settings(tree, {{"orientation", "scene"}}), options);
        for (const Ray &ray : rays) {
            const Hit hit = turned->closest(ray);
            EXPECT_TRUE(same_bits(hit, brute->closest(ray)));
            hits += is_primitive(hit.triangle);
        }
    }
    EXPECT_GT(hits, rays.size() / 20);
}

TEST(Orientation, PlanesAreTheUsers) {
    const TriangleSet set = grid_of_boxes(4, 0.4f);
    const Orientation found = find_orientation(set);
    const auto tree = make_accelerator(set, make_settings("kd", {{"orientation", "scene"}}));
    ASSERT_FALSE(tree->planes().empty());
    std::size_t at_walls = 0;
    for (const Plane &plane : tree->planes()) {
        const Vec3d normal = to_double(plane.normal);
        double along = 0, nearest = HUGE_VAL;
        for (const Vec3d &axis : found.axes())
            along = std::max(along, std::abs(dot(axis, normal)));
        EXPECT_NEAR(along, norm(normal), 1e-6);
        for (const Triangle &t : set.triangles)
            nearest = std::min(nearest, std::abs(dot(normal, to_double(t.a)) - double(plane.offset)));
        at_walls += nearest < 1e-5;
    }
    EXPECT_GT(at_walls, tree->planes().size() * 9 / 10);
}

TEST(Orientation, MakesATurnedSceneAsCheapAsAStraightOne) {
    const auto size = [](float angle, const char *orientation) {
        const auto tree =
            make_accelerator(grid_of_boxes(12, angle), make_settings("kd", {{"orientation", orientation}}));
        return double(tree->statistics().references);
    };
    EXPECT_LT(size(0.5f, "scene"), 1.2 * size(0, "user"));
    EXPECT_GT(size(0.5f, "user"), 1.5 * size(0, "user"));
}

} // namespace
