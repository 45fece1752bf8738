/// The shape `nativekdtree`: meshes and shapes of one primitive under Mitsuba's own kd-tree, the baseline of every
/// comparison. Properties: the `kd_*` settings that Mitsuba's scene takes, `count` (rays, steps and tests are counted),
/// `check` (answers that differ from those of all triangles are counted), `expand` (see bspmember.cpp).
#include "native_tree.h"

#include <chrono>

#include "member.h"
#include "ray_counters.h"
#include "variants.h"

NAMESPACE_BEGIN(mitsuba)

namespace {

/// A setting of Mitsuba's kd-tree. Boolean if there is no range.
struct Setting {
    const char *name, *values;
    bool whole = false;
    double lowest = 0, highest = -1;

    bool is_flag() const { return highest < lowest; }
};

constexpr double huge = 1 << 30;
constexpr Setting settings[] = {
    {"kd_intersection_cost", "a number from 1e-6 to 2^30", false, 1e-6, huge},
    {"kd_traversal_cost", "a number from 1e-6 to 2^30", false, 1e-6, huge},
    {"kd_empty_space_bonus", "a number from 1e-6 to 1", false, 1e-6, 1},
    {"kd_stop_prims", "an integer from 1 to 2^30", true, 1, huge},
    {"kd_max_depth", "an integer from 0 to 48, where 0 means 8 + 1.3 log2(triangles)", true, 0, MI_KD_MAXDEPTH},
    {"kd_min_max_bins", "an integer from 2 to 2^20", true, 2, 1 << 20},
    {"kd_clip", "true or false"},
    {"kd_retract_bad_splits", "true or false"},
    {"kd_exact_primitive_threshold", "an integer from 2 to 2^30, above kd_stop_prims", true, 2, huge},
};

bool is_valid(const Properties &props, const Setting &setting) {
    const Properties::Type type = props.type(setting.name);
    if (setting.is_flag())
        return type == Properties::Type::Bool;
    if (type != Properties::Type::Integer && (setting.whole || type != Properties::Type::Float))
        return false;
    const double value = props.get<double>(setting.name);
    return value >= setting.lowest && value <= setting.highest;
}

/// The settings of Mitsuba's kd-tree among a plugin's properties, checked.
Properties read_settings(const Properties &props) {
    Properties found(props.plugin_name());
    std::vector<std::string> names{"count", "check", "expand"};
    for (const Setting &setting : settings) {
        names.push_back(setting.name);
        if (!props.has_property(setting.name))
            continue;
        if (!is_valid(props, setting))
            Throw("%s=%s is not valid: %s is %s", setting.name, props.as_string(setting.name), setting.name,
                  setting.values);
        if (setting.is_flag())
            found.set(setting.name, props.get<bool>(setting.name));
        else if (setting.whole)
            found.set(setting.name, props.get<int64_t>(setting.name));
        else
            found.set(setting.name, props.get<double>(setting.name));
    }
    check_names(props, "a nativekdtree", names);
    const int64_t stop = found.get<int64_t>("kd_stop_prims", 3);
    const int64_t exact = found.get<int64_t>("kd_exact_primitive_threshold", 65536);
    if (exact <= stop)
        Throw("kd_exact_primitive_threshold is %d, but must be above kd_stop_prims, which is %d", exact, stop);
    return found;
}

/// Rays whose answer is not that of a loop over all triangles.
struct Differences {
    std::atomic<uint64_t> missed{0}, farther{0}, ties{0}, shadows_missed{0}, impossible{0};
};

std::ostream &operator<<(std::ostream &os, const Differences &d) {
    return os << "{\"missed\": " << d.missed << ", \"farther\": " << d.farther << ", \"ties\": " << d.ties
              << ", \"shadows_missed\": " << d.shadows_missed << ", \"impossible\": " << d.impossible << "}";
}

} // namespace

template <typename Float, typename Spectrum> class NativeKDTree final : public Group<Float, Spectrum> {
public:
    MI_IMPORT_BASE(Group, m_children, mesh, extent, intersect_primitive, rebuild)
    MI_IMPORT_TYPES(Mesh)
    using typename Base::Hit;
    using Tree = NativeTree<Float, Spectrum>;
    using Intersection = typename Tree::Intersection;

    explicit NativeKDTree(const Properties &props)
        : Base(props, false), m_settings(read_settings(props)), m_count(read_flag(props, "count", false)),
          m_check(read_flag(props, "check", false)) {
        rebuild();
    }

    Hit closest(const Ray3f &ray) const override {
        const Intersection pi = trace<false>(ray);
        if (!pi.is_valid())
            return {};
        return {pi.t, pi.shape_index, pi.prim_index, true, pi.prim_uv};
    }

    bool any(const Ray3f &ray) const override { return trace<true>(ray).is_valid(); }

    Hit intersect(uint32_t child, uint32_t triangle, const Ray3f &ray) const override {
        Ray3f whole = ray;
        whole.maxt = dr::Infinity<ScalarFloat>;
        if (!mesh(child))
            return intersect_primitive(child, triangle, whole);
        const auto [hit, t, uv] = mesh(child)->ray_intersect_triangle_scalar(triangle, whole);
        return hit ? Hit{t, child, triangle, true, uv} : Hit{};
    }

    std::string statistics() const override {
        const auto counts = m_tree->node_counts();
        std::ostringstream oss;
        oss << "{\"spec\": \"native\", \"triangles\": " << m_tree->primitive_count() - m_dropped - m_others
            << ", \"dropped_triangles\": " << m_dropped << ", \"primitives\": " << m_others
            << ", \"nodes\": " << m_tree->node_count() << ", \"interior_nodes\": " << counts.interior
            << ", \"axis_nodes\": " << counts.interior << ", \"oblique_nodes\": 0, \"leaves\": " << counts.leaves
            << ", \"empty_leaves\": " << counts.empty_leaves << ", \"references\": " << m_tree->reference_count()
            << ", \"max_depth\": " << counts.max_depth << ", \"bytes\": " << m_tree->bytes()
            << ", \"build_s\": " << m_build_s;
        if (m_count)
            oss << ", \"counters\": " << m_counters;
        if (m_check)
            oss << ", \"differences\": " << m_differences;
        oss << "}";
        return oss.str();
    }

    MI_DECLARE_CLASS(NativeKDTree)

protected:
    void build() override {
        const auto start = std::chrono::steady_clock::now();
        clear();
        size_t dropped_others = 0;
        for (size_t i = 0; i < m_children.size(); ++i) {
            const size_t dropped = extent(i).others;
            if (!mesh(i) && dropped > 0)
                m_tree->add(new Mesh("", 0, 0), {}); // in its place, so that the others keep their indices
            else if (dropped > 0)
                m_tree->add(finite_copy(*mesh(i)).get(), extent(i).box);
            else
                m_tree->add(m_children[i], extent(i).box);
            (mesh(i) ? m_dropped : dropped_others) += dropped;
            m_others += !mesh(i) && dropped == 0;
        }
        if (m_tree->bbox().valid())
            m_tree->build();
        m_build_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        if (m_dropped > 0)
            Log(Warn, "%d of %d triangles have a vertex that is not finite: they are left out", m_dropped,
                m_tree->primitive_count());
        if (dropped_others > 0)
            Log(Warn, "%d of %d other primitives have a box that is not finite: they are left out", dropped_others,
                m_others + dropped_others);
        Log(Info, "nativekdtree: %d triangles and other primitives, %d nodes, %d references, %.3f s",
            m_tree->primitive_count(), m_tree->node_count(), m_tree->reference_count(), m_build_s);
    }

    void clear() override {
        m_tree = new Tree(m_settings);
        m_dropped = m_others = 0;
    }

    std::string spec() const override { return "native"; }

private:
    template <bool any_hit> Intersection trace(const Ray3f &ray) const {
        if (!m_tree->ready())
            return {};
        const bool counts = m_count || CostWatch::is_on();
        if (!counts && !m_check)
            return m_tree->template ray_intersect_scalar<any_hit>(ray);
        bsp::Counters counters;
        const Intersection found = counts ? m_tree->template count<any_hit>(ray, counters)
                                          : m_tree->template ray_intersect_scalar<any_hit>(ray);
        m_counters.add<any_hit>(counters);
        if (m_check)
            note_difference<any_hit>(found, m_tree->template test_all<any_hit>(ray));
        return found;
    }

    template <bool any_hit> void note_difference(const Intersection &found, const Intersection &right) const {
        if (any_hit)
            m_differences.shadows_missed += right.is_valid() && !found.is_valid();
        else if (!found.is_valid())
            m_differences.missed += right.is_valid();
        else if (found.t != right.t)
            m_differences.farther += found.t > right.t;
        else
            m_differences.ties += found.shape != right.shape || found.prim_index != right.prim_index;
        m_differences.impossible += found.is_valid() && !(right.is_valid() && right.t <= found.t);
    }

    /// A copy in which the triangles with a vertex that is not finite have shrunk to a point, so that the tree, which
    /// would lose its way among such numbers, leaves them out and the others keep their indices.
    static ref<Mesh> finite_copy(Mesh &mesh) {
        ref<Mesh> copy = new Mesh("", mesh.vertex_count(), mesh.face_count());
        copy->vertex_positions_buffer() = mesh.vertex_positions_buffer();
        copy->faces_buffer() = mesh.faces_buffer();
        float *positions = copy->vertex_positions_buffer().data();
        uint32_t *faces = copy->faces_buffer().data();
        const auto is_finite = [&](uint32_t vertex) {
            return std::all_of(positions + 3 * size_t(vertex), positions + 3 * size_t(vertex) + 3,
                               [](float x) { return std::isfinite(x); });
        };
        const auto is_usable = [&](const uint32_t *face) { return std::all_of(face, face + 3, is_finite); };
        uint32_t point = 0; // of a usable triangle
        for (size_t i = 0; i < mesh.face_count(); ++i)
            if (is_usable(faces + 3 * i))
                point = faces[3 * i];
        for (size_t i = 0; i < mesh.face_count(); ++i)
            if (!is_usable(faces + 3 * i))
                std::fill_n(faces + 3 * i, 3, point);
        return copy;
    }

    Properties m_settings;
    bool m_count, m_check;
    size_t m_dropped = 0, m_others = 0; ///< triangles left out, and primitives that are none
    ref<Tree> m_tree;
    double m_build_s = 0;
    mutable RayCounters m_counters;
    mutable Differences m_differences;
};

template class ShapeKDTree<float, Color<float, 3>>;
template class ShapeKDTree<float, mitsuba::Spectrum<float, 4>>;
template class ShapeKDTree<float, MuellerMatrix<mitsuba::Spectrum<float, 4>>>;

BSP_EXPORT_PLUGIN(NativeKDTree)

NAMESPACE_END(mitsuba)
