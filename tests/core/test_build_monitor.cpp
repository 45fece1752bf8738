#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <thread>

#include <nanothread/nanothread.h>

#include "accelerator.h"
#include "builder.h"
#include "helpers.h"

using namespace bsp;

namespace {

/// Builds that take long enough to be watched: large nodes are estimated, or swept along all directions.
std::vector<Settings> watched_settings() {
    return {make_settings("normals", {}),
            make_settings("random", {{"k", "5"}, {"axes", "none"}, {"exact_below", "1000000"}})};
}

/// What a monitor says until `done`, and at the end.
std::vector<double> watch(const BuildMonitor &monitor, const std::atomic<bool> &done) {
    std::vector<double> seen{monitor.progress()};
    while (!done) {
        seen.push_back(monitor.progress());
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    seen.push_back(monitor.progress());
    return seen;
}

class BuildMonitors : public testing::TestWithParam<std::uint32_t> {
protected:
    void SetUp() override { pool_set_size(nullptr, GetParam()); }
    void TearDown() override { pool_set_size(nullptr, m_usual); }

private:
    const std::uint32_t m_usual = pool_size();
};

TEST_P(BuildMonitors, ProgressGrowsFrom0To1) {
    const TriangleSet set = random_soup(34000, 30); // enough for sweeps in parallel
    for (const Settings &settings : watched_settings()) {
        BuildMonitor monitor;
        std::atomic<bool> done{false};
        std::vector<double> seen;
        std::thread watcher([&] { seen = watch(monitor, done); });
        const Tree tree = build_tree(set, settings, &monitor);
        done = true;
        watcher.join();
        EXPECT_EQ(seen.front(), 0) << full_spec(settings);
        EXPECT_TRUE(std::is_sorted(seen.begin(), seen.end())) << full_spec(settings);
        EXPECT_NEAR(seen.back(), 1, 1e-9) << full_spec(settings);
        EXPECT_TRUE(std::any_of(seen.begin(), seen.end(), [](double x) { return x > 0.1 && x < 0.9; }));
        EXPECT_EQ(validate(tree, set), "");
    }
}

TEST_P(BuildMonitors, CancelEndsTheBuildInItsMidst) {
    const TriangleSet set = random_soup(34000, 31);
    for (const Settings &settings : watched_settings()) {
        BuildMonitor monitor;
        std::thread canceller([&] {
            while (monitor.progress() == 0)
                std::this_thread::yield();
            monitor.cancel();
        });
        EXPECT_THROW(build_tree(set, settings, &monitor), BuildCancelled) << full_spec(settings);
        canceller.join();
        EXPECT_GT(monitor.progress(), 0);
        EXPECT_LT(monitor.progress(), 1) << full_spec(settings);
        // Other builds go on as if nothing had been.
        EXPECT_EQ(validate(build_tree(set, make_settings("kd", {})), set), "");
    }
}

INSTANTIATE_TEST_SUITE_P(Threads, BuildMonitors, testing::Values(1u, 4u));

TEST(BuildMonitor, EveryTreeEndsAt1) {
    for (const char *name : {"kd", "rbsp", "ize", "random", "normals", "clustered"})
        for (const char *cost : {"measured", "thesis"})
            for (const std::size_t count : {0u, 1u, 2u, 700u}) {
                BuildMonitor monitor;
                build_tree(random_soup(count, 32), make_settings(name, {{"cost", cost}}), &monitor);
                EXPECT_NEAR(monitor.progress(), 1, 1e-9) << name << " of " << count << ", cost=" << cost;
            }
}

TEST(BuildMonitor, WatchingChangesNothing) {
    const TriangleSet set = random_soup(3000, 33);
    BuildMonitor monitor;
    const Settings settings = make_settings("normals", {});
    const Tree watched = build_tree(set, settings, &monitor), alone = build_tree(set, settings);
    EXPECT_EQ(watched.references, alone.references);
    EXPECT_EQ(watched.sah_cost, alone.sah_cost);
}

TEST(BuildMonitor, WhatIsCancelledBeforeItBeginsIsNotBuiltAndNotKept) {
    const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "cancelled-trees";
    std::filesystem::remove_all(folder);
    const TriangleSet set = random_soup(100, 34);
    for (const char *name : {"kd", "ize", "normals"}) {
        BuildMonitor monitor;
        monitor.cancel();
        EXPECT_THROW(make_accelerator(set, make_settings(name, {}), {folder.string(), &monitor}), BuildCancelled);
        EXPECT_THROW(survey_planes(set, make_settings(name, {}), &monitor), BuildCancelled);
        EXPECT_EQ(monitor.progress(), 0);
    }
    EXPECT_TRUE(!std::filesystem::exists(folder) || std::filesystem::is_empty(folder));
    std::filesystem::remove_all(folder);
}

} // namespace
