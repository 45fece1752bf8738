#include <gtest/gtest.h>

#include <stdexcept>

#include "settings.h"

using namespace bsp;

namespace {

std::string message_of(const std::string &tree, const Options &options) {
    try {
        make_settings(tree, options);
    } catch (const std::invalid_argument &error) {
        return error.what();
    }
    return "";
}

std::string text_of(const SettingValue &value) {
    if (const auto *flag = std::get_if<bool>(&value))
        return *flag ? "true" : "false";
    if (const auto *word = std::get_if<std::string>(&value))
        return *word;
    if (const auto *number = std::get_if<double>(&value))
        return std::to_string(*number);
    return std::to_string(std::get<std::int64_t>(value));
}

TEST(Settings, DefaultsAndOptions) {
    const Settings s = make_settings("normals", {{"k", "8"}, {"axes", "plain"}, {"seed", "7"}, {"alpha", "0.25"}});
    EXPECT_EQ(s.tree, TreeKind::normals);
    EXPECT_EQ(s.k, 8);
    EXPECT_EQ(s.axes, AxesPolicy::plain);
    EXPECT_EQ(s.seed, 7u);
    EXPECT_EQ(s.cost.alpha, 0.25);
    EXPECT_EQ(make_settings("kd", {}).k, 3);
}

TEST(Settings, LayoutAndPresetDecideDefaults) {
    EXPECT_EQ(make_settings("normals", {}).layout, LayoutKind::wide);
    const CostModel wide = make_settings("normals", {{"layout", "wide"}}).cost;
    const CostModel binary = make_settings("normals", {{"alpha", "0.2"}, {"layout", "binary"}}).cost;
    EXPECT_LT(wide.oblique_cost, binary.oblique_cost);
    EXPECT_EQ(binary.alpha, 0.2) << "what is set stays set";
    EXPECT_EQ(make_settings("kd", {{"cost", "thesis"}}).layout, LayoutKind::binary);
    EXPECT_EQ(make_settings("kd", {{"layout", "wide"}, {"cost", "thesis"}}).layout, LayoutKind::wide);
    EXPECT_EQ(make_settings("kd", {{"layout", "wide"}, {"cost", "thesis"}}).cost.intersection_cost, 80);
}

TEST(Settings, MistakesNameThemselvesAndTheValidChoices) {
    std::string trees;
    for (const std::string &name : tree_names())
        trees += (trees.empty() ? "" : ", ") + name;
    EXPECT_EQ(message_of("bvh", {}), "there is no tree 'bvh': the trees are " + trees);
    EXPECT_EQ(message_of("normals", {{"axes", "slow"}}), "axes=slow is not valid: axes is one of none, plain, fast");
    EXPECT_EQ(message_of("kd", {{"simd", "sse"}}), "simd=sse is not valid: simd is one of auto, avx2, avx512");
    for (const char *k : {"0", "1000", "33", "-1", "2.5", "six", "", "6x", "nan", "1e400"})
        EXPECT_EQ(message_of("random", {{"k", k}}),
                  std::string("k=") + k + " is not valid: k is an integer from 1 to 32");
    EXPECT_NE(
        message_of("kd", {{"colour", "red"}}).find("kd has no setting 'colour': its settings are triangle_test, "),
        std::string::npos);
    EXPECT_EQ(message_of("kd", {{"precision", "high"}}),
              "precision=high is not valid: precision is one of auto, fast, epsilon, safe");
    EXPECT_EQ(message_of("kd", {{"early_exit", "plane"}, {"precision", "fast"}}),
              "early_exit=plane is not valid with precision=fast, which has no bound to leave out; precision=safe has");
    EXPECT_NE(message_of("kd", {{"k", "6"}}).find("kd has no setting 'k'"), std::string::npos);
    EXPECT_EQ(message_of("brute", {{"seed", "1"}}), "brute has no setting 'seed': its settings are triangle_test");
    EXPECT_EQ(message_of("normals", {{"intersection_cost", "0"}}),
              "intersection_cost=0 is not valid: intersection_cost is a number above 0");
}

TEST(Settings, AxesCountAmongTheDirections) {
    EXPECT_NE(message_of("normals", {{"k", "2"}}).find("k=2 is not valid with axes=fast"), std::string::npos);
    EXPECT_NE(message_of("normals", {{"k", "2"}, {"axes", "plain"}}), "");
    EXPECT_EQ(message_of("ize", {{"axes", "none"}}), "axes=none is not valid: axes is one of plain, fast");
    EXPECT_EQ(message_of("ize", {{"axes", "plain"}}), "");
    EXPECT_NE(message_of("ize", {{"k", "6"}}).find("ize has no setting 'k': its settings are axes, "),
              std::string::npos);
    EXPECT_EQ(message_of("normals", {{"axes", "none"}, {"k", "1"}}), "");
}

TEST(Settings, FixedDirectionsHaveSetsOfTheirOwn) {
    EXPECT_EQ(make_settings("rbsp", {}).k, 13);
    for (const char *k : {"3", "7", "9", "13"})
        EXPECT_EQ(message_of("rbsp", {{"k", k}}), "");
    EXPECT_EQ(message_of("rbsp", {{"k", "8"}}),
              "k=8 is not valid with directions=kdop: its sets have 3, 7, 9 or 13 directions; directions=spiral takes "
              "any k from 3 to 32");
    EXPECT_EQ(message_of("rbsp", {{"k", "8"}, {"directions", "spiral"}}), "");
    EXPECT_NE(message_of("rbsp", {{"k", "2"}, {"directions", "spiral"}}), "");
    EXPECT_EQ(message_of("rbsp", {{"axes", "none"}}), "axes=none is not valid: axes is one of plain, fast");
    EXPECT_NE(message_of("rbsp", {{"seed", "1"}}), "");
    EXPECT_NE(message_of("normals", {{"directions", "kdop"}}), "");
}

TEST(Settings, OnlyBinaryNodesCacheDotProducts) {
    EXPECT_EQ(message_of("rbsp", {{"cached_dots", "false"}, {"layout", "binary"}}), "");
    EXPECT_EQ(message_of("rbsp", {{"cached_dots", "false"}}),
              "cached_dots=false is not valid with layout=wide, whose nodes never cache them; layout=binary does");
    EXPECT_NE(message_of("random", {{"cached_dots", "false"}}), "");
}

TEST(Settings, TreesTellWhichPlanesTheyLookAt) {
    const auto planes = [](const char *tree, const Options &options) {
        const TreeTraits traits = traits_of(make_settings(tree, options));
        EXPECT_NE(traits.planes, "");
        return std::pair(traits.planes_per_triangle, traits.recurring_per_triangle);
    };
    EXPECT_EQ(planes("kd", {}), std::pair(6, 6));
    EXPECT_EQ(planes("rbsp", {{"k", "9"}}), std::pair(18, 18));
    EXPECT_EQ(planes("ize", {}), std::pair(10, 10));
    EXPECT_EQ(planes("normals", {{"k", "8"}}), std::pair(16, 6));
    EXPECT_EQ(planes("random", {{"k", "8"}, {"axes", "none"}}), std::pair(16, 0));
    EXPECT_EQ(planes("brute", {}), std::pair(0, 0));
}

TEST(Settings, PresetsAreDefaultsWhereverTheyStand) {
    const Settings thesis = make_settings("normals", {{"alpha", "0.2"}, {"clip", "true"}, {"cost", "thesis"}});
    EXPECT_EQ(thesis.cost.intersection_cost, 80);
    EXPECT_EQ(thesis.cost.oblique_price, ObliquePrice::linear);
    EXPECT_EQ(thesis.cost.alpha, 0.2);
    EXPECT_TRUE(thesis.clip);
    EXPECT_FALSE(thesis.retract || thesis.cost.retry);
    EXPECT_TRUE(make_settings("normals", {{"cost", "ize"}}).cost.retry);
    EXPECT_NE(message_of("kd", {{"cost", "cheap"}}).find("one of measured, thesis, ize"), std::string::npos);
}

TEST(Settings, FullSpecSaysEverythingAndIsASpec) {
    const Settings s = make_settings("clustered", {{"k", "5"}, {"alpha", "0.05"}});
    const std::string text = full_spec(s);
    EXPECT_EQ(text.substr(0, 33), "clustered:k=5,axes=fast,weighting");
    Options options;
    for (const auto &[name, value] : list_settings(s))
        options.emplace_back(name, text_of(value));
    EXPECT_EQ(full_spec(make_settings("clustered", options)), text);
    EXPECT_EQ(settings_help("clustered").size(), list_settings(s).size());
}

} // namespace
