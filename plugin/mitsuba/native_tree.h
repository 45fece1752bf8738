/// Mitsuba's own kd-tree.
///
/// Mitsuba's wheel traces with Embree and leaves its kd-tree out of the library, but the whole builder and traversal
/// are in its header. Only a constructor and two small functions are missing; they are below, with the header's own
/// defaults.
#pragma once

#include <mitsuba/render/mesh.h>

#include <mitsuba/render/kdtree.h>

#include "../core/ray.h"

NAMESPACE_BEGIN(mitsuba)

template <typename B, typename I, typename C, typename D>
thread_local typename TShapeKDTree<B, I, C, D>::LocalBuildContext TShapeKDTree<B, I, C, D>::BuildTask::m_local{};

/// The settings in `props` must be valid; those that are missing are the header's.
MI_VARIANT
ShapeKDTree<Float, Spectrum>::ShapeKDTree(const Properties &props)
    : Base(SurfaceAreaHeuristic3f(props.get<ScalarFloat>("kd_intersection_cost", 20.f),
                                  props.get<ScalarFloat>("kd_traversal_cost", 15.f),
                                  props.get<ScalarFloat>("kd_empty_space_bonus", .9f))) {
    if (props.has_property("kd_stop_prims"))
        set_stop_primitives(props.get<uint32_t>("kd_stop_prims"));
    if (props.has_property("kd_max_depth"))
        set_max_depth(props.get<uint32_t>("kd_max_depth"));
    if (props.has_property("kd_min_max_bins"))
        set_min_max_bins(props.get<uint32_t>("kd_min_max_bins"));
    if (props.has_property("kd_clip"))
        set_clip_primitives(props.get<bool>("kd_clip"));
    if (props.has_property("kd_retract_bad_splits"))
        set_retract_bad_splits(props.get<bool>("kd_retract_bad_splits"));
    if (props.has_property("kd_exact_primitive_threshold"))
        set_exact_primitive_threshold(props.get<uint32_t>("kd_exact_primitive_threshold"));
    m_primitive_map = {0};
}

MI_VARIANT void ShapeKDTree<Float, Spectrum>::build() { Base::build(); }

MI_VARIANT std::string ShapeKDTree<Float, Spectrum>::to_string() const {
    return "ShapeKDTree[]";
}

/// The numbers and the steps that Mitsuba keeps to itself.
template <typename Float, typename Spectrum> class NativeTree final : public ShapeKDTree<Float, Spectrum> {
public:
    using Base = ShapeKDTree<Float, Spectrum>;
    using typename Base::KDNode;
    using typename Base::Mesh;
    using typename Base::ScalarBoundingBox3f;
    using typename Base::ScalarFloat;
    using typename Base::ScalarRay3f;
    using typename Base::Shape;
    using Intersection = PreliminaryIntersection<ScalarFloat, Shape>;

    struct NodeCounts {
        size_t interior = 0, leaves = 0, empty_leaves = 0, max_depth = 0;
    };

    using Base::Base;

    /// `box`: of a mesh's triangles. Mitsuba takes the mesh's own box, which is too small for merged rectangles.
    void add(ref<Shape> shape, const ScalarBoundingBox3f &box) {
        this->m_shapes.push_back(shape.get());
        this->m_primitive_map.push_back(this->m_primitive_map.back() + shape->primitive_count());
        this->m_bbox.expand(box);
    }

    size_t node_count() const { return this->m_node_count; }
    size_t reference_count() const { return this->m_index_count; }
    /// Nodes and lists of triangles, as they lie in memory.
    std::vector<std::pair<const void *, size_t>> memory() const {
        return {{this->m_nodes.get(), node_count() * sizeof(KDNode)},
                {this->m_indices.get(), reference_count() * sizeof(uint32_t)}};
    }
    size_t bytes() const { return node_count() * sizeof(KDNode) + reference_count() * sizeof(uint32_t); }

    /// What can be reached from the root: Mitsuba also keeps the nodes of splits that it has taken back.
    NodeCounts node_counts() const {
        NodeCounts found;
        if (this->ready())
            visit(this->m_nodes.get(), 0, found);
        return found;
    }

    /// Visits what `ray_intersect_scalar<any_hit>` visits, in the same order and with the same arithmetic, so that it
    /// returns the same answer, and counts. A plane is crossed at t; the side of the origin is near, the other far.
    template <bool any_hit> Intersection count(ScalarRay3f ray, bsp::Counters &counters) const {
        ++counters.rays;
        Intersection found;
        if (!this->ready())
            return found;
        struct Pending {
            const KDNode *node;
            ScalarFloat begin, end;
        };
        Pending stack[MI_KD_MAXDEPTH];
        int pending = 0;
        const auto [touches, enters, leaves] = this->m_bbox.ray_intersect(ray);
        const auto inverse = dr::rcp(ray.d);
        ScalarFloat begin = std::max(ScalarFloat(0), enters), end = std::min(ray.maxt, leaves);
        for (const KDNode *node = this->m_nodes.get(); begin <= end;) {
            if (!node->leaf()) {
                ++counters.axis_steps;
                const uint32_t axis = node->axis();
                const ScalarFloat offset = node->split(), o = ray.o[axis], t = (offset - o) * inverse[axis];
                const bool from_left = o < offset || (o == offset && ray.d[axis] >= 0);
                const KDNode *near_node = from_left ? node->left() : node->right();
                const KDNode *far_node = from_left ? node->right() : node->left();
                if (t > end || t < 0 || !dr::isfinite(t)) {
                    node = near_node;
                } else if (t < begin) {
                    node = far_node;
                } else {
                    stack[pending++] = {far_node, t, end};
                    node = near_node;
                    end = t;
                }
                continue;
            }
            counters.leaves += node->primitive_count() > 0;
            for (uint32_t i = 0; i < node->primitive_count(); ++i) {
                ++counters.triangle_tests;
                const Intersection hit =
                    this->template intersect_prim<any_hit>(this->m_indices[node->primitive_offset() + i], ray);
                if (!hit.is_valid())
                    continue;
                found = hit;
                if (any_hit)
                    return found;
                ray.maxt = hit.t;
            }
            if (pending == 0)
                break;
            --pending;
            node = stack[pending].node;
            begin = stack[pending].begin;
            end = std::min(stack[pending].end, ray.maxt);
        }
        return found;
    }

    /// The answer of a loop over all triangles with Mitsuba's own test; equal t goes to the smaller number. Backwards,
    /// for the test accepts a hit that is as far as the last one.
    template <bool any_hit> Intersection test_all(ScalarRay3f ray) const {
        Intersection found;
        for (uint32_t i = this->primitive_count(); i-- > 0 && !(any_hit && found.is_valid());) {
            const Intersection hit = this->template intersect_prim<any_hit>(i, ray);
            if (!hit.is_valid())
                continue;
            found = hit;
            ray.maxt = any_hit ? ray.maxt : hit.t;
        }
        return found;
    }

private:
    static void visit(const KDNode *node, size_t depth, NodeCounts &found) {
        found.max_depth = std::max(found.max_depth, depth);
        if (node->leaf()) {
            ++found.leaves;
            found.empty_leaves += node->primitive_count() == 0;
            return;
        }
        ++found.interior;
        visit(node->left(), depth + 1, found);
        visit(node->right(), depth + 1, found);
    }
};

NAMESPACE_END(mitsuba)
