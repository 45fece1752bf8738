#include <gtest/gtest.h>

#include <functional>

#include <nanothread/nanothread.h>

#include "accelerator.h"
#include "builder.h"
#include "helpers.h"

using namespace bsp;

namespace {

struct Count {
    std::size_t leaves = 0, references = 0;
};

/// Leaves at depth `limit` that list more than one triangle.
Count large_leaves_at(int limit, const Tree &tree) {
    Count count;
    const std::function<void(std::size_t, int)> visit = [&](std::size_t at, int depth) {
        const TreeNode &node = tree.nodes[at];
        if (node.kind == TreeNode::Kind::leaf) {
            if (depth == limit && node.count > 1) {
                ++count.leaves;
                count.references += node.count;
            }
            return;
        }
        visit(at + 1, depth + 1);
        visit(node.above, depth + 1);
    };
    visit(0, 0);
    return count;
}

/// Two triangles whose boxes overlap: to part them, one must be listed twice.
TriangleSet overlapping_pair() {
    return make_set({{{0, 0, 0}, {2, 2, 0}, {0, 0, 2}}, {{3, 1, 1}, {1, 3, 1}, {1, 1, 3}}});
}

TEST(CappedLeaves, AreThoseThatTheDepthStops) {
    const TriangleSet set = random_soup(10000, 20); // enough for subtrees in parallel
    const std::uint32_t usual = pool_size();
    for (const char *tree_name : {"kd", "normals"})
        for (const char *depth : {"1", "4", "9"}) {
            // Without retraction, after which one capped leaf stands for all below it, at any depth.
            const Settings settings =
                make_settings(tree_name, {{"max_depth", depth}, {"retract", "false"}, {"max_references", "1000"}});
            for (const std::uint32_t threads : {1u, 4u}) {
                pool_set_size(nullptr, threads);
                const Tree tree = build_tree(set, settings);
                const Count expected = large_leaves_at(settings.max_depth, tree);
                EXPECT_EQ(tree.capped_leaves, expected.leaves) << full_spec(settings);
                EXPECT_EQ(tree.capped_references, expected.references) << full_spec(settings);
                EXPECT_GT(tree.capped_leaves, 0u);
            }
        }
    pool_set_size(nullptr, usual);
}

TEST(CappedLeaves, AreThoseThatTheBudgetStops) {
    const TriangleSet set = overlapping_pair();
    const auto statistics = [&](const char *max_references) {
        return make_accelerator(set,
                                make_settings("kd", {{"intersection_cost", "100"}, {"max_references", max_references}}))
            ->statistics();
    };
    const Statistics capped = statistics("1");
    EXPECT_EQ(capped.leaves, 1u);
    EXPECT_EQ(capped.capped_leaves, 1u);
    EXPECT_EQ(capped.capped_references, 2u);
    EXPECT_EQ(capped.references, 2u);
    const Statistics free = statistics("1000");
    EXPECT_GT(free.references, 2u);
    EXPECT_EQ(free.capped_leaves, 0u);
}

TEST(CappedLeaves, AreNoMoreThanThereAreLeaves) {
    const Statistics s =
        make_accelerator(random_soup(1000, 19), make_settings("kd", {{"max_depth", "6"}}))->statistics();
    EXPECT_GT(s.capped_leaves, 0u);
    EXPECT_LE(s.capped_leaves, s.leaves);
}

TEST(CappedLeaves, AreNoneWhereLeavesAreWanted) {
    for (const char *name : {"kd", "normals", "rbsp"}) {
        const Settings settings = make_settings(name, {{"max_depth", "60"}, {"max_references", "1000"}});
        EXPECT_EQ(build_tree(random_soup(1000, 21), settings).capped_leaves, 0u) << name;
        EXPECT_EQ(build_tree(TriangleSet{}, settings).capped_leaves, 0u) << name;
    }
    // As small as they were asked to be, at the depth limit or not.
    const Settings large = make_settings("kd", {{"leaf_size", "2"}, {"max_depth", "1"}, {"max_references", "1"}});
    EXPECT_EQ(build_tree(overlapping_pair(), large).capped_leaves, 0u);
}

TEST(CappedLeaves, AreWarnedOfWhereTheyHoldMuchOfTheTree) {
    const auto warning = [](const char *max_depth) {
        const Settings settings = make_settings("kd", {{"max_depth", max_depth}, {"max_references", "1000"}});
        return make_accelerator(random_soup(1000, 23), settings)->statistics().warning;
    };
    EXPECT_EQ(warning("60"), "");
    EXPECT_EQ(warning("1"), "100 % of the tree's references are in leaves that were not split further, because there "
                            "are at most 1000 references per triangle (max_references) and 1 levels (max_depth): rays "
                            "that meet them are slow");
}

TEST(CappedLeaves, AreInTheStatistics) {
    const auto accelerator =
        make_accelerator(random_soup(500, 22), make_settings("kd", {{"max_depth", "3"}, {"retract", "false"}}));
    const Statistics &statistics = accelerator->statistics();
    EXPECT_EQ(statistics.capped_leaves, 8u);
    EXPECT_NE(to_json(statistics).find("\"capped_leaves\": 8,"), std::string::npos);
    EXPECT_NE(to_json(statistics).find("\"capped_references\": " + std::to_string(statistics.references)),
              std::string::npos);
}

} // namespace
