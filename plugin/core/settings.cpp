#include "settings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <optional>
#include <stdexcept>

#include "simd.h"

namespace bsp {
namespace {

[[noreturn]] void refuse(const std::string &sentence) { throw std::invalid_argument(sentence); }

std::string join(const std::vector<std::string> &words) {
    std::string text;
    for (const std::string &word : words)
        text += (text.empty() ? "" : ", ") + word;
    return text;
}

std::string number_text(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.12g", value);
    return text;
}

std::string value_text(const SettingValue &value) {
    if (const auto *word = std::get_if<std::string>(&value))
        return *word;
    if (const auto *flag = std::get_if<bool>(&value))
        return *flag ? "true" : "false";
    if (const auto *integer = std::get_if<std::int64_t>(&value))
        return std::to_string(*integer);
    return number_text(std::get<double>(value));
}

double parse_number(const std::string &key, const std::string &text, double lowest, double highest,
                    const std::string &values, bool integer) {
    double value = 0;
    std::size_t used = 0;
    try {
        value = std::stod(text, &used);
    } catch (const std::exception &) {
        used = 0;
    }
    const bool whole = value == std::floor(value);
    if (used == 0 || used != text.size() || !(value >= lowest && value <= highest) || (integer && !whole))
        refuse(key + "=" + text + " is not valid: " + key + " is " + values);
    return value;
}

/// The trees that a setting has a meaning for.
enum class For { all, tree, automatic, seeded, built, oblique, swept, drawn, normals, axes_held, rbsp };

bool applies(For trees, TreeKind tree) {
    const bool automatic = tree == TreeKind::automatic;
    const bool built = !automatic && tree != TreeKind::brute, oblique = built && tree != TreeKind::kd;
    const bool rbsp = tree == TreeKind::rbsp, axes_held = rbsp || tree == TreeKind::ize;
    switch (trees) {
    case For::all:
        return true;
    case For::tree:
        return built || automatic;
    case For::automatic:
        return automatic;
    case For::seeded:
        return automatic || (oblique && !axes_held);
    case For::built: // by settings, not by what `auto` finds
        return built;
    case For::oblique:
        return oblique;
    case For::swept: // oblique directions are swept
        return oblique && tree != TreeKind::ize;
    case For::drawn: // directions are drawn anew in every node
        return oblique && !axes_held;
    case For::normals:
        return tree == TreeKind::normals || tree == TreeKind::clustered;
    case For::axes_held: // the axes are always among the planes
        return axes_held;
    case For::rbsp:
        return rbsp;
    }
    return false;
}

/// A setting: how it is called, what it may be, where it lives.
struct Key {
    std::string name, values, meaning;
    For trees;
    std::function<SettingValue(const Settings &)> get;
    std::function<void(Settings &, const std::string &)> set;
};

template <typename Enum> struct Word {
    const char *name;
    Enum value;
};

constexpr std::array<Word<TreeKind>, 8> tree_words{{{"auto", TreeKind::automatic},
                                                    {"kd", TreeKind::kd},
                                                    {"rbsp", TreeKind::rbsp},
                                                    {"ize", TreeKind::ize},
                                                    {"random", TreeKind::random},
                                                    {"normals", TreeKind::normals},
                                                    {"clustered", TreeKind::clustered},
                                                    {"brute", TreeKind::brute}}};
static_assert(tree_words.size() == std::size_t(TreeKind::brute) + 1 && tree_words.back().value == TreeKind::brute);
constexpr std::array<Word<AxesPolicy>, 3> axes_words{
    {{"none", AxesPolicy::none}, {"plain", AxesPolicy::plain}, {"fast", AxesPolicy::fast}}};
constexpr std::array<Word<OrientationKind>, 2> orientation_words{
    {{"user", OrientationKind::user}, {"scene", OrientationKind::scene}}};
constexpr std::array<Word<DirectionSet>, 2> directions_words{
    {{"kdop", DirectionSet::kdop}, {"spiral", DirectionSet::spiral}}};
constexpr std::array<Word<Weighting>, 2> weighting_words{
    {{"triangle", Weighting::triangle}, {"area", Weighting::area}}};
constexpr std::array<Word<CostPreset>, 3> preset_words{
    {{"measured", CostPreset::measured}, {"thesis", CostPreset::thesis}, {"ize", CostPreset::ize}}};
constexpr std::array<Word<bool>, 2> flag_words{{{"true", true}, {"false", false}}};
/// Of trees that always hold the axes.
constexpr std::array<Word<AxesPolicy>, 2> always_axes_words{{{"plain", AxesPolicy::plain}, {"fast", AxesPolicy::fast}}};
constexpr std::array<Word<TriangleTest>, 2> test_words{{{"woop", TriangleTest::woop}, {"mt", TriangleTest::mt}}};
constexpr std::array<Word<EarlyExit>, 2> exit_words{{{"bound", EarlyExit::bound}, {"plane", EarlyExit::plane}}};
constexpr std::array<Word<LayoutKind>, 2> layout_words{{{"binary", LayoutKind::binary}, {"wide", LayoutKind::wide}}};
constexpr std::array<Word<Simd>, 3> simd_words{{{"auto", Simd::best}, {"avx2", Simd::avx2}, {"avx512", Simd::avx512}}};
constexpr std::array<Word<Precision>, 4> precision_words{{{"auto", Precision::automatic},
                                                          {"fast", Precision::fast},
                                                          {"epsilon", Precision::epsilon},
                                                          {"safe", Precision::safe}}};
constexpr std::array<Word<ObliquePrice>, 3> price_words{
    {{"constant", ObliquePrice::constant}, {"linear", ObliquePrice::linear}, {"surcharge", ObliquePrice::surcharge}}};

template <typename Words> std::string choices(const Words &words) {
    std::vector<std::string> names;
    for (const auto &word : words)
        names.emplace_back(word.name);
    return "one of " + join(names);
}

template <typename Enum, std::size_t N> std::string word_of(const std::array<Word<Enum>, N> &words, Enum value) {
    for (const auto &word : words)
        if (word.value == value)
            return word.name;
    refuse("internal error: a setting without a name");
}

template <typename Enum, std::size_t N>
Key word_key(std::string name, std::string meaning, For trees, const std::array<Word<Enum>, N> &words,
             std::function<Enum &(Settings &)> field) {
    return {name,
            choices(words),
            std::move(meaning),
            trees,
            [&words, field](const Settings &s) { return word_of(words, field(const_cast<Settings &>(s))); },
            [&words, field, name](Settings &s, const std::string &text) {
                for (const auto &word : words)
                    if (text == word.name) {
                        field(s) = word.value;
                        return;
                    }
                refuse(name + "=" + text + " is not valid: " + name + " is " + choices(words));
            }};
}

template <typename Integer>
Key integer_key(std::string name, std::string meaning, For trees, std::int64_t lowest, std::int64_t highest,
                std::string values, std::function<Integer &(Settings &)> field) {
    return {name,
            values,
            std::move(meaning),
            trees,
            [field](const Settings &s) { return std::int64_t(field(const_cast<Settings &>(s))); },
            [=](Settings &s, const std::string &text) {
                field(s) = Integer(parse_number(name, text, double(lowest), double(highest), values, true));
            }};
}

Key number_key(std::string name, std::string meaning, For trees, double lowest, double highest, std::string values,
               std::function<double &(Settings &)> field) {
    return {name,
            values,
            std::move(meaning),
            trees,
            [field](const Settings &s) { return field(const_cast<Settings &>(s)); },
            [=](Settings &s, const std::string &text) {
                field(s) = parse_number(name, text, lowest, highest, values, false);
            }};
}

Key flag_key(std::string name, std::string meaning, For trees, std::function<bool &(Settings &)> field) {
    Key key = word_key<bool>(std::move(name), std::move(meaning), trees, flag_words, field);
    key.values = "true or false";
    key.get = [field](const Settings &s) { return field(const_cast<Settings &>(s)); };
    return key;
}

/// The keys whose values decide the defaults of others.
constexpr const char *preset_key = "cost", *layout_key = "layout";

std::vector<Key> direction_keys() {
    return {
        integer_key<int>("k", "directions swept at a node, the axes included", For::swept, 1, 32,
                         "an integer from 1 to 32", [](Settings &s) -> int & { return s.k; }),
        word_key<DirectionSet>("directions",
                               "kdop: components -1, 0 and 1, k is 3, 7, 9 or 13; spiral: the axes and a golden-ratio "
                               "spiral, k from 3 up",
                               For::rbsp, directions_words, [](Settings &s) -> DirectionSet & { return s.directions; }),
        flag_key("cached_dots",
                 "binary nodes: dot products of a ray with the directions are computed once per ray (Budge et al. "
                 "2008); if not, in every node",
                 For::rbsp, [](Settings &s) -> bool & { return s.cached_dots; }),
        word_key<AxesPolicy>(
            "axes", "x, y, z among the directions: none; plain, as any other; fast, with kd nodes of their own",
            For::drawn, axes_words, [](Settings &s) -> AxesPolicy & { return s.axes; }),
        word_key<AxesPolicy>("axes", "x, y, z are: plain, swept as any other; fast, with kd nodes of their own",
                             For::axes_held, always_axes_words, [](Settings &s) -> AxesPolicy & { return s.axes; }),
        word_key<Weighting>("weighting",
                            "triangles lend their normals: triangle, all alike; area, in proportion to their area "
                            "inside the node",
                            For::normals, weighting_words, [](Settings &s) -> Weighting & { return s.weighting; }),
        integer_key<std::uint64_t>("seed", "seed of every random choice of the builder", For::seeded, 0,
                                   std::int64_t(1) << 53, "an integer from 0 to 2^53",
                                   [](Settings &s) -> std::uint64_t & { return s.seed; }),
        word_key<TriangleTest>(
            "triangle_test", "woop: watertight (Woop, Benthin, Wald 2013); mt: the arithmetic of Mitsuba's own meshes",
            For::all, test_words, [](Settings &s) -> TriangleTest & { return s.triangle_test; }),
        word_key<EarlyExit>("early_exit",
                            "the search ends at a hit before all cells that begin behind it: bound, with certainty; "
                            "plane, as computed, which may lose a closer hit; goes with precision=safe",
                            For::tree, exit_words, [](Settings &s) -> EarlyExit & { return s.early_exit; }),
        word_key<LayoutKind>(layout_key,
                             "nodes of seven planes tested at once (wide) or of one, as in the papers (binary)",
                             For::built, layout_words, [](Settings &s) -> LayoutKind & { return s.layout; }),
        word_key<OrientationKind>(
            "orientation",
            "the tree's x, y and z, and all directions: user, as the coordinates are; scene, turned to the three "
            "perpendicular directions along which most of the area faces",
            For::built, orientation_words, [](Settings &s) -> OrientationKind & { return s.orientation; }),
        word_key<Simd>("simd", "instructions for wide nodes, the best of this processor or these; answers are the same",
                       For::tree, simd_words, [](Settings &s) -> Simd & { return s.simd; }),
        word_key<Precision>(
            "precision",
            "where a ray's interval is cut it is widened: safe, by a bound on all rounding errors, so "
            "that no hit is lost; epsilon, by 1e-5 of the largest coordinate (up to a factor of 2) along "
            "the ray; fast, not at all; auto, by what is the cheapest that loses no hit, which is the bound: what "
            "rays need depends on where they begin, and so no scene alone allows less",
            For::tree, precision_words, [](Settings &s) -> Precision & { return s.precision; }),
    };
}

std::vector<Key> cost_keys() {
    constexpr double huge = 1e9;
    return {
        word_key<CostPreset>(preset_key,
                             "defaults of all prices and rules below: measured on this project's traversal of the "
                             "layout; thesis: the published code; ize: the thesis's prices with the rule of Ize, Wald, "
                             "Parker; both with binary nodes",
                             For::built, preset_words, [](Settings &s) -> CostPreset & { return s.preset; }),
        number_key("intersection_cost", "price of one triangle test", For::built, 1e-9, huge, "a number above 0",
                   [](Settings &s) -> double & { return s.cost.intersection_cost; }),
        number_key("leaf_cost", "price of a visit of a leaf that is not empty, besides its tests", For::built, 0, huge,
                   "a number from 0 up", [](Settings &s) -> double & { return s.cost.leaf_cost; }),
        number_key("node_cost",
                   "price of a visit of a wide node, besides its planes; a node of one plane has none of its own",
                   For::built, 0, huge, "a number from 0 up", [](Settings &s) -> double & { return s.cost.node_cost; }),
        number_key("axis_cost", "price of one axis-aligned plane", For::built, 0, huge, "a number from 0 up",
                   [](Settings &s) -> double & { return s.cost.axis_cost; }),
        number_key("oblique_cost", "price of one oblique plane", For::oblique, 0, huge, "a number from 0 up",
                   [](Settings &s) -> double & { return s.cost.oblique_cost; }),
        word_key<ObliquePrice>(
            "oblique_price",
            "how oblique splits of n triangles are priced: constant: oblique_cost; linear: axis_cost + "
            "alpha * intersection_cost * (n - 1), the thesis; surcharge: oblique_cost + the same",
            For::oblique, price_words, [](Settings &s) -> ObliquePrice & { return s.cost.oblique_price; }),
        number_key("alpha", "how the price of oblique splits grows with the node", For::oblique, 0, huge,
                   "a number from 0 up", [](Settings &s) -> double & { return s.cost.alpha; }),
        flag_key("retry", "where nothing beats the leaf, oblique splits are tried again at oblique_cost", For::oblique,
                 [](Settings &s) -> bool & { return s.cost.retry; }),
        number_key("empty_bonus", "factor on the children's price when one of them is empty", For::built, 0, 1,
                   "a number from 0 to 1", [](Settings &s) -> double & { return s.cost.empty_bonus; }),
    };
}

std::vector<Key> rule_keys() {
    return {
        integer_key<int>("leaf_size", "nodes with this many triangles or fewer are leaves", For::built, 1, 1 << 20,
                         "an integer from 1 to 1048576", [](Settings &s) -> int & { return s.leaf_size; }),
        integer_key<int>(
            "exact_below",
            "nodes with more triangles choose their direction by bins and sweep only that one; ize tries the "
            "planes of at most 256 of their triangles",
            For::built, 1, 1 << 30, "an integer from 1 to 2^30", [](Settings &s) -> int & { return s.exact_below; }),
        flag_key("clip", "triangles are clipped to the cell; if not, their whole extents count", For::built,
                 [](Settings &s) -> bool & { return s.clip; }),
        integer_key<int>("bad_refines", "splits dearer than a leaf that may follow one another", For::built, 0,
                         depth_limit, "an integer from 0 to 60", [](Settings &s) -> int & { return s.bad_refines; }),
        flag_key("retract",
                 "splits that do not pay in the end are undone; if not, they stay, and where one costs more than 4 "
                 "times a leaf of fewer than 16 triangles it is not made",
                 For::built, [](Settings &s) -> bool & { return s.retract; }),
        integer_key<int>("max_depth", "levels of interior nodes; 0: depth_margin + 1.6 log2(triangles), at most 60",
                         For::tree, 0, depth_limit, "an integer from 0 to 60",
                         [](Settings &s) -> int & { return s.max_depth; }),
        number_key("depth_margin", "see max_depth", For::tree, 0, depth_limit, "a number from 0 to 60",
                   [](Settings &s) -> double & { return s.depth_margin; }),
        number_key("max_references", "cap on references per triangle over the whole tree", For::tree, 1, 1000,
                   "a number from 1 to 1000", [](Settings &s) -> double & { return s.max_references; }),
        number_key("expected_rays",
                   "rays that will be traced: for few a tree that is built quickly is chosen, for many one that is "
                   "traced quickly",
                   For::automatic, 0, 1e18, "a number from 0 to 1e18",
                   [](Settings &s) -> double & { return s.expected_rays; }),
    };
}

std::vector<Key> make_keys() {
    std::vector<Key> keys = direction_keys();
    for (const auto &more : {cost_keys(), rule_keys()})
        keys.insert(keys.end(), more.begin(), more.end());
    return keys;
}

const std::vector<Key> &all_keys() {
    static const std::vector<Key> keys = make_keys();
    return keys;
}

std::vector<const Key *> keys_of(TreeKind tree) {
    std::vector<const Key *> keys;
    for (const Key &key : all_keys())
        if (applies(key.trees, tree))
            keys.push_back(&key);
    return keys;
}

TreeKind parse_tree(const std::string &name) {
    for (const auto &word : tree_words)
        if (name == word.name)
            return word.value;
    refuse("there is no tree '" + name + "': the trees are " + join(tree_names()));
}

Settings defaults_of(TreeKind tree) {
    Settings settings;
    settings.tree = tree;
    if (tree == TreeKind::kd || tree == TreeKind::ize)
        settings.k = 3;
    else if (tree == TreeKind::rbsp)
        settings.k = 13;
    return settings;
}

/// Sets what `preset` and, if one is asked for, `layout` decide.
void apply_preset(CostPreset preset, std::optional<LayoutKind> layout, Settings &s) {
    s.preset = preset;
    if (!layout && preset != CostPreset::measured)
        s.layout = LayoutKind::binary;
    if (preset == CostPreset::measured) {
        if (s.layout == LayoutKind::binary)
            s.cost = {0.15, 0, 0, 1.0, 1.1, ObliquePrice::surcharge, 0.1, true, 0.9};
        return;
    }
    s.cost = {80, 0, 0, 1, 5, ObliquePrice::linear, 0.1, preset == CostPreset::ize, 1.0};
    if (preset == CostPreset::ize)
        return;
    s.exact_below = 1 << 30;
    s.clip = s.retract = false;
    s.bad_refines = 2;
    s.depth_margin = 2;
    s.max_references = 1000;
}

void check_together(const Settings &s) {
    if (s.simd == Simd::avx512 && !has_avx512())
        refuse("simd=avx512 is not valid here: this processor lacks AVX-512 F, VL, DQ or BW; simd is auto or avx2");
    if (!s.cached_dots && s.layout == LayoutKind::wide)
        refuse("cached_dots=false is not valid with layout=wide, whose nodes never cache them; layout=binary does");
    if (s.early_exit == EarlyExit::plane && (s.precision == Precision::fast || s.precision == Precision::epsilon))
        refuse("early_exit=plane is not valid with precision=" + word_of(precision_words, s.precision) +
               ", which has no bound to leave out; precision=safe has");
    const std::string k = "k=" + std::to_string(s.k);
    if (s.tree == TreeKind::rbsp) {
        const bool kdop = s.k == 3 || s.k == 7 || s.k == 9 || s.k == 13;
        if (s.directions == DirectionSet::kdop && !kdop)
            refuse(k + " is not valid with directions=kdop: its sets have 3, 7, 9 or 13 directions; directions=spiral "
                       "takes any k from 3 to 32");
    }
    if (s.axes != AxesPolicy::none && s.k < 3)
        refuse(k + " is not valid with axes=" + word_of(axes_words, s.axes) +
               ": k counts the three axes, so it is 3 or more" +
               (s.tree == TreeKind::rbsp ? "" : "; with axes=none it may be 1 or more"));
}

} // namespace

std::vector<std::string> tree_names() {
    std::vector<std::string> names;
    for (const auto &word : tree_words)
        names.emplace_back(word.name);
    return names;
}

Settings make_settings(const std::string &tree, const Options &options) {
    Settings settings = defaults_of(parse_tree(tree));
    const std::vector<const Key *> keys = keys_of(settings.tree);
    const auto set = [&](const std::string &name, const std::string &text) {
        const auto found = std::find_if(keys.begin(), keys.end(), [&](const Key *key) { return key->name == name; });
        if (found == keys.end()) {
            std::vector<std::string> names;
            for (const Key *key : keys)
                names.push_back(key->name);
            refuse(tree + " has no setting '" + name + "': its settings are " + join(names));
        }
        (*found)->set(settings, text);
    };
    std::optional<LayoutKind> layout;
    for (const auto &[name, text] : options) // these first, wherever they stand: the others change what they set
        if (name == preset_key || name == layout_key) {
            set(name, text);
            if (name == layout_key)
                layout = settings.layout;
        }
    apply_preset(settings.preset, layout, settings);
    for (const auto &[name, text] : options)
        set(name, text);
    check_together(settings);
    return settings;
}

std::vector<std::pair<std::string, SettingValue>> list_settings(const Settings &settings) {
    std::vector<std::pair<std::string, SettingValue>> list;
    for (const Key *key : keys_of(settings.tree))
        list.emplace_back(key->name, key->get(settings));
    return list;
}

std::string full_spec(const Settings &settings) {
    std::string text = word_of(tree_words, settings.tree);
    char separator = ':';
    for (const auto &[name, value] : list_settings(settings)) {
        text += separator + name + "=" + value_text(value);
        separator = ',';
    }
    return text;
}

std::vector<SettingHelp> settings_help(const std::string &tree) {
    const Settings defaults = defaults_of(parse_tree(tree));
    std::vector<SettingHelp> help;
    for (const Key *key : keys_of(defaults.tree))
        help.push_back({key->name, key->values, key->meaning, key->get(defaults)});
    return help;
}

TreeTraits traits_of(const Settings &s) {
    const int axes = s.axes == AxesPolicy::none ? 0 : 6, swept = 2 * s.k;
    const std::string besides = s.axes == AxesPolicy::none ? "" : "x, y, z and ";
    switch (s.tree) {
    case TreeKind::automatic:
        return {"those of kd or normals, whichever it chooses", true, true, swept, 6};
    case TreeKind::kd:
        return {"x, y, z", false, false, 6, 6};
    case TreeKind::rbsp:
        return {"one set of directions for the whole tree, x, y, z among them", false, false, swept, swept};
    case TreeKind::ize:
        return {"x, y, z, and along every triangle four planes: its own, and those through its edges "
                "perpendicular to it",
                true, false, 10, 10};
    case TreeKind::random:
        return {besides + "random directions, new in every node", false, true, swept, axes};
    case TreeKind::normals:
        return {besides + "the normals of random triangles of the node", true, true, swept, axes};
    case TreeKind::clustered:
        return {besides + "the centres of a clustering of the node's normals", true, true, swept, axes};
    case TreeKind::brute:
        return {"none: every triangle is tested", false, false, 0, 0};
    }
    throw std::logic_error("a tree that says nothing of itself");
}

} // namespace bsp
