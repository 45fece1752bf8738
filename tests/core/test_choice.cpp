#include <gtest/gtest.h>

#include "builder.h"
#include "choice.h"
#include "expected_work.h"
#include "helpers.h"

using namespace bsp;

namespace {

Choice choose(const TriangleSet &set, const char *rays, const char *seed = "1") {
    return choose_tree(set, make_settings("auto", {{"expected_rays", rays}, {"seed", seed}}));
}

TEST(Choice, NothingObliqueIsTriedWhereAllLiesAlongTheAxes) {
    for (const char *rays : {"0", "1e6", "1e12"}) {
        const Choice choice = choose(grid_of_boxes(12, 0), rays);
        EXPECT_EQ(choice.settings.tree, TreeKind::kd);
        EXPECT_NE(choice.reason.find("100 % of the area lies along the axes"), std::string::npos) << choice.reason;
        EXPECT_EQ(choice.reason.find("parts of"), std::string::npos) << choice.reason;
    }
}

TEST(Choice, TurnedBoxesGetAxesOfTheirOwn) {
    for (const char *rays : {"0", "1e12"}) {
        const Choice choice = choose(grid_of_boxes(12, 0.5f), rays);
        EXPECT_EQ(choice.settings.tree, TreeKind::kd) << choice.reason;
        EXPECT_EQ(choice.settings.orientation, OrientationKind::scene) << choice.reason;
        EXPECT_NE(choice.reason.find("100 % along those of the scene itself"), std::string::npos) << choice.reason;
        EXPECT_EQ(choice.reason.find("parts of"), std::string::npos) << choice.reason;
    }
}

TEST(Choice, GridsTurnedEachItsOwnWayAreCutAlongTheirFaces) {
    const Choice choice = choose(grids_askew(12), "1e12");
    EXPECT_EQ(choice.settings.tree, TreeKind::normals) << choice.reason;
    EXPECT_NE(choice.reason.find("parts of"), std::string::npos) << choice.reason;
}

TEST(Choice, FewRaysGetAQuickBuildAndNoPilots) {
    const Choice quick = choose(grid_of_boxes(12, 0.5f), "0"), good = choose(grid_of_boxes(12, 0), "1e12");
    EXPECT_EQ(quick.settings.tree, TreeKind::kd);
    EXPECT_GT(quick.settings.leaf_size, good.settings.leaf_size);
    EXPECT_EQ(quick.reason.find("parts of"), std::string::npos) << quick.reason;
    EXPECT_LT(quick.build_s, good.build_s);
    EXPECT_EQ(quick.trace_s, 0);
}

TEST(Choice, PilotsAreFlownOnlyWhereTheyCouldSaveMoreThanTheyTake) {
    const TriangleSet set = random_soup(20000, 5);
    EXPECT_EQ(choose(set, "3e5").reason.find("parts of"), std::string::npos);
    EXPECT_NE(choose(set, "3e7").reason.find("parts of"), std::string::npos);
}

TEST(Choice, PilotsAreNotFlownWhereBoxesAreTight) {
    std::vector<Triangle> triangles = squares_of_boxes(12, 0); // and as many again that lie askew, much smaller
    for (const Triangle &t : squares_of_boxes(12, 0.3f)) {
        const auto small = [](const Vec3f &v) { return Vec3f{0.3f * v.x + 40, 0.3f * v.y, 0.3f * v.z}; };
        triangles.push_back({small(t.a), small(t.b), small(t.c)});
    }
    const Choice choice = choose(make_set(triangles), "1e12");
    EXPECT_EQ(choice.settings.tree, TreeKind::kd);
    EXPECT_EQ(choice.reason.find("100 %"), std::string::npos) << choice.reason;
    EXPECT_NE(choice.reason.find("directions, its boxes are 2."), std::string::npos) << choice.reason;
    EXPECT_EQ(choice.reason.find("parts of"), std::string::npos) << choice.reason;
}

/// Cells of boxes that were turned and then sheared, so that their faces are no longer perpendicular.
TriangleSet sheared_boxes(int side) {
    std::vector<Triangle> triangles = squares_of_boxes(side, 0.7f);
    for (Triangle &t : triangles)
        for (Vec3f *v : {&t.a, &t.b, &t.c})
            *v = {v->x + 2 * v->y + 1.5f * v->z, v->y + 1.7f * v->x, v->z + 1.1f * v->x - 1.3f * v->y};
    return make_set(triangles);
}

TEST(Choice, MoreDirectionsAreSweptOnlyWhereTrianglesFaceInMore) {
    const Choice few = choose(sheared_boxes(12), "1e14"), many = choose(grids_askew(12, 12), "1e14");
    ASSERT_EQ(few.settings.tree, TreeKind::normals) << few.reason;
    ASSERT_EQ(many.settings.tree, TreeKind::normals) << many.reason;
    EXPECT_EQ(few.settings.k, make_settings("normals", {}).k) << few.reason;
    EXPECT_EQ(many.settings.k, 9) << many.reason;
}

TEST(Choice, MoreRaysNeverGetAQuickerBuild) {
    const TriangleSet set = random_soup(3000, 1);
    double before = 0;
    for (double rays = 1; rays < 1e14; rays *= 3) {
        Settings settings = make_settings("auto", {});
        settings.expected_rays = rays;
        const double build_s = choose_tree(set, settings).build_s;
        EXPECT_GE(build_s, before) << rays;
        before = build_s;
    }
}

TEST(Choice, KeepsWhatItIsToldAndIsTheSameAgain) {
    const TriangleSet set = random_soup(5000, 2);
    const Options told{{"expected_rays", "1e12"}, {"triangle_test", "mt"}, {"precision", "fast"},
                       {"max_depth", "11"},       {"max_references", "3"}, {"seed", "9"}};
    const Choice choice = choose_tree(set, make_settings("auto", told)),
                 again = choose_tree(set, make_settings("auto", told));
    EXPECT_EQ(choice.settings.triangle_test, TriangleTest::mt);
    EXPECT_EQ(choice.settings.precision, Precision::fast);
    EXPECT_EQ(choose_tree(set, make_settings("auto", {{"early_exit", "plane"}})).settings.early_exit, EarlyExit::plane);
    EXPECT_EQ(choice.settings.max_depth, 11);
    EXPECT_EQ(choice.settings.max_references, 3);
    EXPECT_EQ(choice.settings.seed, 9u);
    EXPECT_EQ(choice.reason, again.reason);
    EXPECT_EQ(full_spec(choice.settings), full_spec(again.settings));
    const Settings kd = make_settings("kd", {});
    EXPECT_EQ(full_spec(choose_tree(set, kd).settings), full_spec(kd)) << "other trees are no choice";
}

TEST(Choice, TheSmallestMeshesHaveOne) {
    for (const std::size_t count : {0u, 1u, 2u, 65u})
        EXPECT_GE(choose(random_soup(count, 3), "1e12").build_s, 0) << count;
}

TEST(Choice, TellsWhatItBuilt) {
    const auto tree = make_accelerator(grids_askew(12), make_settings("auto", {{"expected_rays", "1e12"}}));
    const Statistics &s = tree->statistics();
    EXPECT_EQ(s.spec.rfind("auto:", 0), 0u) << s.spec;
    EXPECT_EQ(s.chosen.rfind("normals:", 0), 0u) << s.choice;
    EXPECT_GT(s.oblique_nodes, 0u);
    EXPECT_GT(s.choose_s, 0);
    EXPECT_LE(s.choose_s, s.build_s);
    EXPECT_GT(s.predicted_trace_s, s.predicted_build_s);
}

TEST(Choice, OfPrecisionIsSafeAndSaysWhy) {
    const TriangleSet set = random_soup(200, 6);
    const auto chosen = make_accelerator(set, make_settings("kd", {{"precision", "auto"}}));
    EXPECT_EQ(chosen->statistics().precision.rfind("safe, for ", 0), 0u);
    const auto safe = make_accelerator(set, make_settings("kd", {}));
    EXPECT_TRUE(safe->statistics().precision.empty());
    for (const Ray &ray : aimed_rays(set, 300, 7))
        EXPECT_TRUE(same_bits(chosen->closest(ray), safe->closest(ray)));
}

TEST(ExpectedWork, OfOneLeafIsItsTests) {
    const TriangleSet set = make_set({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}});
    const Work work = expected_work(build_tree(set, make_settings("kd", {})));
    EXPECT_EQ(work.leaves, 1);
    EXPECT_EQ(work.tests, 1);
    EXPECT_EQ(work.axis_nodes + work.oblique_nodes, 0);
}

TEST(ExpectedWork, IsWhatTheBuilderPredicts) {
    const TriangleSet set = random_soup(400, 4);
    for (const char *spec : {"kd", "normals"}) {
        // With these prices the builder's prediction is a sum of counts: of wide nodes, leaves and tests.
        const Options prices{{"node_cost", "1"}, {"axis_cost", "0"},         {"oblique_cost", "0"},
                             {"leaf_cost", "1"}, {"intersection_cost", "1"}, {"empty_bonus", "1"}};
        Options options = prices;
        if (std::string(spec) == "kd")
            options.erase(options.begin() + 2);
        const Tree tree = build_tree(set, make_settings(spec, options));
        const Work work = expected_work(tree);
        EXPECT_NEAR(work.axis_nodes + work.oblique_nodes + work.leaves + work.tests, tree.sah_cost,
                    1e-6 * tree.sah_cost);
        EXPECT_EQ(work.oblique_nodes > 0, std::string(spec) == "normals");
    }
}

} // namespace
