#include "settings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <stdexcept>

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

/// A setting: how it is called, what it may be, where it lives.
struct Key {
    std::string name, values, meaning;
    bool oblique_only; ///< has no meaning for a tree whose directions are the three axes
    std::function<SettingValue(const Settings &)> get;
    std::function<void(Settings &, const std::string &)> set;
};

template <typename Enum> struct Word {
    const char *name;
    Enum value;
};

constexpr std::array<Word<TreeKind>, 6> tree_words{{{"kd", TreeKind::kd},
                                                    {"ize", TreeKind::ize},
                                                    {"random", TreeKind::random},
                                                    {"normals", TreeKind::normals},
                                                    {"clustered", TreeKind::clustered},
                                                    {"brute", TreeKind::brute}}};
constexpr std::array<Word<AxesPolicy>, 3> axes_words{
    {{"none", AxesPolicy::none}, {"plain", AxesPolicy::plain}, {"fast", AxesPolicy::fast}}};
/// Of trees that always hold the axes.
constexpr std::array<Word<AxesPolicy>, 2> always_axes_words{{{"plain", AxesPolicy::plain}, {"fast", AxesPolicy::fast}}};
constexpr std::array<Word<TriangleTest>, 2> test_words{{{"woop", TriangleTest::woop}, {"mt", TriangleTest::mt}}};
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
Key word_key(std::string name, std::string meaning, bool oblique_only, const std::array<Word<Enum>, N> &words,
             std::function<Enum &(Settings &)> field) {
    return {name,
            choices(words),
            std::move(meaning),
            oblique_only,
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
Key integer_key(std::string name, std::string meaning, bool oblique_only, std::int64_t lowest, std::int64_t highest,
                std::string values, std::function<Integer &(Settings &)> field) {
    return {name,
            values,
            std::move(meaning),
            oblique_only,
            [field](const Settings &s) { return std::int64_t(field(const_cast<Settings &>(s))); },
            [=](Settings &s, const std::string &text) {
                field(s) = Integer(parse_number(name, text, double(lowest), double(highest), values, true));
            }};
}

Key number_key(std::string name, std::string meaning, bool oblique_only, double lowest, double highest,
               std::string values, std::function<double &(Settings &)> field) {
    return {name,
            values,
            std::move(meaning),
            oblique_only,
            [field](const Settings &s) { return field(const_cast<Settings &>(s)); },
            [=](Settings &s, const std::string &text) {
                field(s) = parse_number(name, text, lowest, highest, values, false);
            }};
}

std::vector<Key> make_keys() {
    constexpr double huge = 1e9;
    return {
        integer_key<int>("k", "directions swept at a node, the axes included", true, 1, 32, "an integer from 1 to 32",
                         [](Settings &s) -> int & { return s.k; }),
        word_key<AxesPolicy>(
            "axes", "x, y, z among the directions: none; plain, as any other; fast, with kd nodes of their own", true,
            axes_words, [](Settings &s) -> AxesPolicy & { return s.axes; }),
        word_key<AxesPolicy>("axes", "x, y, z are: plain, swept as any other; fast, with kd nodes of their own", true,
                             always_axes_words, [](Settings &s) -> AxesPolicy & { return s.axes; }),
        integer_key<std::uint64_t>("seed", "seed of every random choice of the builder", true, 0, std::int64_t(1) << 53,
                                   "an integer from 0 to 2^53", [](Settings &s) -> std::uint64_t & { return s.seed; }),
        word_key<TriangleTest>(
            "triangle_test", "woop: watertight (Woop, Benthin, Wald 2013); mt: the arithmetic of Mitsuba's own meshes",
            false, test_words, [](Settings &s) -> TriangleTest & { return s.triangle_test; }),
        number_key("intersection_cost", "price of one triangle test", false, 1e-9, huge, "a number above 0",
                   [](Settings &s) -> double & { return s.cost.intersection_cost; }),
        number_key("axis_cost", "price of one step through an axis-aligned node", false, 0, huge, "a number from 0 up",
                   [](Settings &s) -> double & { return s.cost.axis_cost; }),
        number_key("oblique_cost", "price of one step through an oblique node", true, 0, huge, "a number from 0 up",
                   [](Settings &s) -> double & { return s.cost.oblique_cost; }),
        word_key<ObliquePrice>(
            "oblique_price",
            "how oblique splits of n triangles are priced: constant: oblique_cost; linear: axis_cost + "
            "alpha * intersection_cost * (n - 1), the thesis; surcharge: oblique_cost + the same",
            true, price_words, [](Settings &s) -> ObliquePrice & { return s.cost.oblique_price; }),
        number_key("alpha", "how the price of oblique splits grows with the node", true, 0, huge, "a number from 0 up",
                   [](Settings &s) -> double & { return s.cost.alpha; }),
        number_key("empty_bonus", "factor on the children's price when one of them is empty", false, 0, 1,
                   "a number from 0 to 1", [](Settings &s) -> double & { return s.cost.empty_bonus; }),
        integer_key<int>("leaf_size", "nodes with this many triangles or fewer are leaves", false, 1, 1 << 20,
                         "an integer from 1 to 1048576", [](Settings &s) -> int & { return s.leaf_size; }),
        integer_key<int>(
            "bad_refines",
            "splits dearer than a leaf that may follow one another; undone when they do not pay in the end", false, 0,
            depth_limit, "an integer from 0 to 60", [](Settings &s) -> int & { return s.bad_refines; }),
        integer_key<int>("max_depth", "levels of interior nodes; 0 chooses by the number of triangles", false, 0,
                         depth_limit, "an integer from 0 to 60", [](Settings &s) -> int & { return s.max_depth; }),
        number_key("max_references", "cap on references per triangle over the whole tree", false, 1, 1000,
                   "a number from 1 to 1000", [](Settings &s) -> double & { return s.max_references; }),
    };
}

const std::vector<Key> &all_keys() {
    static const std::vector<Key> keys = make_keys();
    return keys;
}

/// Whether the tree has the setting; of the two forms of `axes` it has one.
bool applies(const Key &key, TreeKind tree) {
    if (tree == TreeKind::brute || tree == TreeKind::kd)
        return tree == TreeKind::brute ? key.name == "triangle_test" : !key.oblique_only;
    const bool always_axes = tree == TreeKind::ize; // which has no random choices either
    if (key.name == "axes")
        return (key.values == choices(always_axes_words)) == always_axes;
    return !(always_axes && (key.name == "k" || key.name == "seed"));
}

std::vector<const Key *> keys_of(TreeKind tree) {
    std::vector<const Key *> keys;
    for (const Key &key : all_keys()) {
        if (applies(key, tree))
            keys.push_back(&key);
    }
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
    return settings;
}

void check_together(const Settings &s) {
    if (s.axes != AxesPolicy::none && s.k < 3)
        refuse("k=" + std::to_string(s.k) + " is not valid with axes=" + word_of(axes_words, s.axes) +
               ": k counts the three axes, so it is 3 or more; with axes=none it may be 1 or more");
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
    for (const auto &[name, text] : options) {
        const auto found =
            std::find_if(keys.begin(), keys.end(), [&, &wanted = name](const Key *key) { return key->name == wanted; });
        if (found == keys.end()) {
            std::vector<std::string> names;
            for (const Key *key : keys)
                names.push_back(key->name);
            refuse(tree + " has no setting '" + name + "': its settings are " + join(names));
        }
        (*found)->set(settings, text);
    }
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

} // namespace bsp
