/// What stands for a group's child in the scene: it has the child's id, BSDF, emitter, sensor and media and forwards
/// everything to it, but has no triangles. One member (or two) of a group carries the rays into its accelerator.
#pragma once

#include "group.h"

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum> class Member final : public Shape<Float, Spectrum> {
public:
    MI_IMPORT_BASE(Shape, m_bsdf, m_emitter, m_sensor, m_interior_medium, m_exterior_medium,
                   m_silhouette_sampling_weight, m_dirty, mark_dirty)
    MI_IMPORT_TYPES(BSDF, Medium, Texture)
    using typename Base::ScalarIndex;
    using typename Base::ScalarSize;
    using GroupType = Group<Float, Spectrum>;
    using Hit = typename GroupType::Hit;

    Member(GroupType *group, size_t index)
        : m_group(group), m_index(index), m_child(group->child(index)), m_role(group->role(index)) {
        this->set_id(m_child->id());
        copy_attachments();
        m_group->list_member(m_index, this);
    }

    ~Member() { m_group->forget_member(m_index, this); }

    // -- rays -----------------------------------------------------------------------------------------------------

    /// Embree hands back t and the two floats of prim_uv, which it copies and never computes with: they carry the hit's
    /// child and triangle.
    PreliminaryIntersection3f ray_intersect_preliminary(const Ray3f &ray, ScalarIndex, Mask active) const override {
        PreliminaryIntersection3f pi = dr::zeros<PreliminaryIntersection3f>();
        if (!active || m_role == MemberRole::stand_in)
            return pi;
        const Hit hit = m_role == MemberRole::all ? m_group->closest(ray) : m_group->closest_shared(ray);
        if (!hit.found || !reports(hit.child))
            return pi;
        reported() = {m_group->build_number(), RayNumbers(ray), hit};
        pi.valid = true;
        pi.t = hit.t;
        pi.prim_uv = Point2f(as_float(hit.child), as_float(hit.triangle));
        pi.prim_index = hit.triangle;
        pi.shape = this;
        return pi;
    }

    Mask ray_test(const Ray3f &ray, ScalarIndex, Mask active) const override {
        return active && answers_for_all() && m_group->any(ray);
    }

    SurfaceInteraction3f compute_surface_interaction(const Ray3f &ray, const PreliminaryIntersection3f &pi,
                                                     uint32_t ray_flags, uint32_t /* recursion_depth */,
                                                     Mask active) const override {
        const uint32_t index = as_bits(pi.prim_uv.x()), triangle = as_bits(pi.prim_uv.y());
        PreliminaryIntersection3f inner = pi;
        inner.prim_index = triangle;
        inner.prim_uv = weights(index, triangle, pi.t, ray);
        inner.shape = m_group->child(index);
        // Depth 0, because a mesh that is not marked as an instance answers nothing below it.
        SurfaceInteraction3f si = inner.shape->compute_surface_interaction(ray, inner, ray_flags, 0, active);
        si.shape = m_group->listed_shape(index);
        // An instance reads the index from there once we are done. Its caller's method, which owns it, is not const.
        if (pi.instance != nullptr)
            const_cast<PreliminaryIntersection3f &>(pi).prim_index = triangle;
        return si;
    }

    // -- geometry, as the scene sees it ---------------------------------------------------------------------------

    ScalarSize primitive_count() const override { return m_child->primitive_count(); }
    ScalarSize effective_primitive_count() const override { return m_child->effective_primitive_count(); }
    ScalarBoundingBox3f bbox() const override { return m_child->bbox(); }
    ScalarBoundingBox3f bbox(ScalarIndex index) const override {
        return m_role == MemberRole::stand_in ? m_child->bbox(index) : m_group->padded_bbox(m_role);
    }
    using Base::bbox;

    /// Called before Embree builds: the last moment for the accelerator to be up to date. To Embree a carrier is one
    /// primitive, a stand-in none.
    void describe(ShapeIR &ir) const override {
        m_group->rebuild_if_changed();
        Base::describe(ir);
        ir.prim_count = m_role != MemberRole::stand_in && m_group->padded_bbox(m_role).valid() ? 1 : 0;
    }

    /// The mesh itself, for whoever wants to see it.
    std::vector<ref<Object>> expand() const override { return {ref<Object>(const_cast<Base *>(m_child.get()))}; }

    // -- everything else is the child's ---------------------------------------------------------------------------

    void traverse(TraversalCallback *callback) override { m_child->traverse(callback); }

    void parameters_changed(const std::vector<std::string> &keys) override {
        // Nobody reads the child's own dirty flag, so here it tells whether this edit moved the geometry. Mitsuba does
        // not raise it if only the faces change.
        bool Base::*dirty = &Member::m_dirty;
        const bool before = m_child->dirty();
        m_child->*dirty = false;
        m_child->parameters_changed(keys);
        const bool moved = m_child->dirty() || string::contains(keys, "faces");
        m_child->*dirty |= before;
        copy_attachments();
        if (moved) {
            GroupType::geometry_changed(m_child.get());
            mark_dirty();
        }
    }

    void set_bsdf(BSDF *bsdf) override {
        m_child->set_bsdf(bsdf);
        m_bsdf = bsdf;
    }

    bool has_flipped_normals() const override { return m_child->has_flipped_normals(); }
    Float surface_area() const override { return m_child->surface_area(); }

    PositionSample3f sample_position(Float time, const Point2f &sample, Mask active) const override {
        return m_child->sample_position(time, sample, active);
    }
    Float pdf_position(const PositionSample3f &ps, Mask active) const override {
        return m_child->pdf_position(ps, active);
    }
    DirectionSample3f sample_direction(const Interaction3f &it, const Point2f &sample, Mask active) const override {
        return m_child->sample_direction(it, sample, active);
    }
    Float pdf_direction(const Interaction3f &it, const DirectionSample3f &ds, Mask active) const override {
        return m_child->pdf_direction(it, ds, active);
    }
    SurfaceInteraction3f eval_parameterization(const Point2f &uv, uint32_t ray_flags, Mask active) const override {
        return m_child->eval_parameterization(uv, ray_flags, active);
    }
    void add_texture_attribute(std::string_view name, Texture *texture) override {
        m_child->add_texture_attribute(name, texture);
    }
    void remove_attribute(std::string_view name) override { m_child->remove_attribute(name); }
    Mask has_attribute(std::string_view name, Mask active) const override {
        return m_child->has_attribute(name, active);
    }
    UnpolarizedSpectrum eval_attribute(std::string_view name, const SurfaceInteraction3f &si,
                                       Mask active) const override {
        return m_child->eval_attribute(name, si, active);
    }
    Float eval_attribute_1(std::string_view name, const SurfaceInteraction3f &si, Mask active) const override {
        return m_child->eval_attribute_1(name, si, active);
    }
    Color3f eval_attribute_3(std::string_view name, const SurfaceInteraction3f &si, Mask active) const override {
        return m_child->eval_attribute_3(name, si, active);
    }
    dr::DynamicArray<Float> eval_attribute_x(std::string_view name, const SurfaceInteraction3f &si,
                                             Mask active) const override {
        return m_child->eval_attribute_x(name, si, active);
    }

    std::string to_string() const override {
        std::ostringstream oss;
        oss << "Member[" << std::endl << "  child = " << string::indent(m_child->to_string());
        if (answers_for_all())
            oss << "," << std::endl << "  group = " << string::indent(m_group->describe_self());
        oss << std::endl << "]";
        return oss.str();
    }

    MI_DECLARE_CLASS(Member)

private:
    /// Whether this carrier answers any-hit rays, and speaks for the group in text.
    bool answers_for_all() const { return m_role == MemberRole::all || m_role == MemberRole::surfaces; }

    bool reports(uint32_t child) const {
        return m_role == MemberRole::all || m_group->child(child)->is_emitter() == (m_role == MemberRole::emitters);
    }

    /// The last hit that this thread has told Embree.
    struct Reported {
        uint64_t build = 0;
        RayNumbers ray;
        Hit hit;
    };
    static Reported &reported() {
        static thread_local Reported last;
        return last;
    }

    /// Barycentrics, for which Embree's answer has no room. The hit that is described is nearly always the last that
    /// was found. If it is another one it is found again, in this one triangle.
    ///
    /// An instance describes a hit by a ray that it has turned into its own space, and Embree has found it by another,
    /// turned as well: a little different, so that it may just miss the triangle, or very different, for Mitsuba's
    /// inverse of a rotation around an axis that is not normalised is wrong.
    Point2f weights(uint32_t child, uint32_t triangle, float t, const Ray3f &ray) const {
        const Reported &last = reported();
        const bool is_last = last.build == m_group->build_number() && last.hit.child == child &&
                             last.hit.triangle == triangle && last.hit.t == t;
        if (is_last && last.ray == RayNumbers(ray))
            return last.hit.uv;
        const Hit again = m_group->intersect(child, triangle, ray);
        if (again.found && dr::abs(again.t - t) <= 1e-3f * dr::abs(t))
            return again.uv;
        return is_last ? last.hit.uv : again.found ? again.uv : m_group->nearest(child, triangle, ray);
    }

    /// Those that Mitsuba reads without a virtual call.
    void copy_attachments() {
        m_bsdf = m_child->bsdf();
        m_emitter = m_child->emitter();
        m_sensor = m_child->sensor();
        m_interior_medium = const_cast<Medium *>(m_child->interior_medium());
        m_exterior_medium = const_cast<Medium *>(m_child->exterior_medium());
        m_silhouette_sampling_weight = m_child->silhouette_sampling_weight();
    }

    static float as_float(uint32_t bits) {
        float value;
        std::memcpy(&value, &bits, sizeof value);
        return value;
    }
    static uint32_t as_bits(float value) {
        uint32_t bits;
        std::memcpy(&bits, &value, sizeof bits);
        return bits;
    }

    mutable ref<GroupType> m_group; ///< `describe`, which Embree calls before it builds, lets it build too
    size_t m_index;
    ref<Base> m_child;
    MemberRole m_role;
};

template <typename Float, typename Spectrum> ref<Shape<Float, Spectrum>> Group<Float, Spectrum>::member(size_t index) {
    return new Member<Float, Spectrum>(this, index);
}

NAMESPACE_END(mitsuba)
