/// What a spec says: which tree, how it is built, which triangle test. The one place where defaults are written.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace bsp {

enum class TreeKind { automatic, kd, rbsp, ize, random, normals, clustered, brute };
enum class AxesPolicy { none, plain, fast };
enum class TriangleTest { woop, mt };
/// Where a cell behind a plane begins for a ray that has hit something: a cell that begins behind the hit is not
/// visited.
enum class EarlyExit {
    bound, ///< as early as rounding errors allow, so that what is left out is behind the hit for certain
    plane, ///< where the plane was computed to be, as is usual
};
/// How a traversal allows for rounding errors where it cuts a ray's interval at a plane or at the scene's box.
enum class Precision {
    fast,      ///< not at all
    epsilon,   ///< by a fixed distance, 1e-5 of the largest coordinate: the historical baseline
    safe,      ///< by a bound on all errors: the answer is that of a loop over all triangles
    automatic, ///< the cheapest that is known to lose no ray: so far always `safe`
};
/// How nodes are stored and traversed.
enum class LayoutKind {
    binary, ///< one plane a node, as in the papers
    wide,   ///< seven planes a node, tested at once
};
/// Levels of planes in a node of `LayoutKind::wide`.
constexpr int wide_levels = 3;

/// The instructions that wide nodes are traversed with. They decide nothing but the time it takes.
enum class Simd {
    best, ///< AVX-512 where the processor has it
    avx2,
    avx512,
};
/// The axes of a tree, along which its `x`, `y` and `z` are.
enum class OrientationKind {
    user,  ///< those of the coordinates
    scene, ///< perpendicular ones along which most of the area faces
};
/// The fixed directions of `rbsp`.
enum class DirectionSet {
    kdop,   ///< components -1, 0 and 1, for k = 3, 7, 9, 13: Klosowski et al. 1998
    spiral, ///< the axes and points on a golden-ratio spiral, for any k: Kammaje, Mora 2007
};
/// Which of a node's triangles lend their normals.
enum class Weighting {
    triangle, ///< each is as likely as any other
    area,     ///< in proportion to the area of its part inside the node
};
/// Where the defaults of prices and stop rules come from; each may be set on its own as well.
enum class CostPreset {
    measured, ///< on this project's own traversal of the layout
    thesis,   ///< the published code of Hoobergs 2019: no clipping, no retry, no retraction, exact sweeps
    ize,      ///< the thesis's constants with the rule of Ize, Wald, Parker 2008: linear price, then a constant one
};
/// What an oblique split of n triangles costs when splits are compared; the step itself always costs `oblique_cost`.
enum class ObliquePrice {
    constant,  ///< oblique_cost
    linear,    ///< axis_cost + alpha * intersection_cost * (n - 1): Ize, Wald, Parker 2008; Hoobergs 2019
    surcharge, ///< oblique_cost + alpha * intersection_cost * (n - 1)
};

/// Prices of the surface area heuristic (MacDonald, Booth 1990). Only their ratios matter. The defaults are those of
/// wide nodes, a visit of which costs 3.
struct CostModel {
    double intersection_cost = 0.12; ///< one triangle test
    double leaf_cost = 1.0;          ///< one visit of a leaf that is not empty, besides its tests
    double node_cost = 2.4;          ///< one visit of a node, besides its planes: paid by the plane at its root
    double axis_cost = 0.2;          ///< one axis-aligned plane on a ray's way
    double oblique_cost = 0.4;       ///< one oblique plane
    ObliquePrice oblique_price = ObliquePrice::surcharge;
    double alpha = 0.06;      ///< how the price of oblique splits grows with the node
    bool retry = true;        ///< where nothing beats the leaf, oblique splits are tried again at `oblique_cost`
    double empty_bonus = 0.9; ///< factor on the children's cost when one of them is empty

    /// Of a leaf of `count` triangles that a ray meets for certain.
    double leaf_price(std::size_t count) const {
        return count == 0 ? 0 : leaf_cost + intersection_cost * double(count);
    }
    /// Of two leaves whose cells have these shares of their parent's area, the step to them aside.
    double split_price(double share_below, std::size_t below, double share_above, std::size_t above) const {
        const double bonus = below == 0 || above == 0 ? empty_bonus : 1.0;
        return bonus * (share_below * leaf_price(below) + share_above * leaf_price(above));
    }
};

struct Settings {
    TreeKind tree = TreeKind::kd;
    int k = 6; ///< directions swept at a node, the axes included
    AxesPolicy axes = AxesPolicy::fast;
    OrientationKind orientation = OrientationKind::user;
    std::uint64_t seed = 0;
    DirectionSet directions = DirectionSet::kdop;
    bool cached_dots = true; ///< binary nodes: n.o and n.d once per ray and direction, where directions are few
    Weighting weighting = Weighting::triangle;
    TriangleTest triangle_test = TriangleTest::woop;
    EarlyExit early_exit = EarlyExit::bound;
    LayoutKind layout = LayoutKind::wide;
    Simd simd = Simd::best;
    Precision precision = Precision::safe;
    CostPreset preset = CostPreset::measured;
    CostModel cost;
    int leaf_size = 1;           ///< nodes with this many triangles or fewer are not split
    int exact_below = 32;        ///< larger nodes choose their direction by bins, then sweep that one
    bool clip = true;            ///< triangles are clipped to the cell; else their whole extents count
    int bad_refines = 1;         ///< splits dearer than a leaf that may follow one another
    bool retract = true;         ///< splits that did not pay in the end are undone
    int max_depth = 0;           ///< levels of interior nodes; 0: depth_margin + 1.6 log2(n), at most depth_limit
    double depth_margin = 8;     ///< see `max_depth`
    double max_references = 8.0; ///< cap on references per triangle, over the whole tree
    double expected_rays = 5e7;  ///< automatic: what the choice between quick builds and quick rays is made for
};

/// No tree is deeper than this; the traversal stack has room for it.
constexpr int depth_limit = 60;

using SettingValue = std::variant<bool, std::int64_t, double, std::string>;
using Options = std::vector<std::pair<std::string, std::string>>;

/// One line of the documentation of a setting.
struct SettingHelp {
    std::string name, values, meaning;
    SettingValue default_value;
};

/// Names of all trees, in the order they are listed to users.
std::vector<std::string> tree_names();

/// The settings of `tree` with `options` (key, value) applied to the defaults. Throws std::invalid_argument with one
/// sentence that names the mistake and the valid choices.
Settings make_settings(const std::string &tree, const Options &options);

/// Every setting that `settings.tree` has, with its value, in a fixed order.
std::vector<std::pair<std::string, SettingValue>> list_settings(const Settings &settings);

/// NAME:key=value,... with every setting of the tree.
std::string full_spec(const Settings &settings);

/// What the settings mean, in the same order; `tree` as in `make_settings`.
std::vector<SettingHelp> settings_help(const std::string &tree);

/// What a tree says of itself: the planes that a node of n triangles looks at. Table 2.1 of Hoobergs's draft.
struct TreeTraits {
    std::string planes;         ///< in words
    bool from_triangles;        ///< they depend on the normals of the node's triangles
    bool drawn;                 ///< some are drawn at random, from `seed`
    int planes_per_triangle;    ///< looked at in a node, at most: this times n
    int recurring_per_triangle; ///< of these, those that the nodes below look at again, unless they are cut off
};
TreeTraits traits_of(const Settings &settings);

} // namespace bsp
