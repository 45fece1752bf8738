/// Meshes, and other shapes that Mitsuba can intersect one ray at a time, under one accelerator.
///
/// A group gives way (Object::expand) to one member per child (member.h), so that the scene's lists of shapes, emitters
/// and sensors and its parameter names are those of the scene without the group. One member also carries the rays into
/// the accelerator: Embree calls it as a user geometry. If some children emit and others do not there are two carriers,
/// for `hide_emitters` asks the shape that Embree reports, before the child is known, whether it emits.
#pragma once

#include <mitsuba/core/plugin.h>
#include <mitsuba/render/emitter.h>
#include <mitsuba/render/mesh.h>
#include <mitsuba/render/scene.h>
#include <mitsuba/render/scene_ir.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <exception>
#include <limits>
#include <mutex>
#include <vector>

#include "extent.h"
#include "nearest_point.h"
#include "plugin_properties.h"

NAMESPACE_BEGIN(mitsuba)

/// Origin and direction, to tell rays apart by their bits.
struct RayNumbers {
    std::array<float, 6> numbers{};

    RayNumbers() = default;
    template <typename Ray>
    explicit RayNumbers(const Ray &ray) : numbers{ray.o.x(), ray.o.y(), ray.o.z(), ray.d.x(), ray.d.y(), ray.d.z()} {}
    bool operator==(const RayNumbers &other) const {
        return std::memcmp(&numbers, &other.numbers, sizeof numbers) == 0;
    }
};

/// Which of the accelerator's hits a member reports.
enum class MemberRole {
    stand_in, ///< none
    all,      ///< every hit: all children emit, or none does
    surfaces, ///< hits on children that do not emit
    emitters, ///< hits on children that do
};

template <typename Float, typename Spectrum> class Member;

template <typename Float, typename Spectrum> class Group : public Shape<Float, Spectrum> {
public:
    MI_IMPORT_BASE(Shape)
    MI_IMPORT_TYPES(Mesh, Scene)
    using typename Base::ScalarSize;

    /// The triangle that a ray hits first, and the weights of its second and third vertex there. Of a child that is no
    /// mesh: its primitive, and what it calls `prim_uv`.
    struct Hit {
        ScalarFloat t = std::numeric_limits<ScalarFloat>::infinity();
        uint32_t child = 0, triangle = 0;
        bool found = false;
        ScalarPoint2f uv = 0;
    };

    // -- what an accelerator does. Nothing that a ray can reach throws. ---------------------------------------------

    virtual Hit closest(const Ray3f &ray) const = 0;
    virtual bool any(const Ray3f &ray) const = 0;
    /// The hit of a ray with one triangle or primitive alone, however far; not found if it misses.
    virtual Hit intersect(uint32_t child, uint32_t triangle, const Ray3f &ray) const = 0;
    /// One JSON object.
    virtual std::string statistics() const = 0;

    // -- what members ask. Virtual where the code must be that of the plugin that made the group. --------------------

    /// `closest` for a group with two carriers, which ask for the same ray in turn: the ray is traced for the first
    /// only.
    virtual Hit closest_shared(const Ray3f &ray) const {
        static thread_local Answer last;
        const RayNumbers numbers(ray);
        if (last.build != m_build || !(last.ray == numbers) || !(last.maxt >= ray.maxt))
            last = {m_build, numbers, ray.maxt, closest(ray)};
        Hit hit = last.hit;
        hit.found &= hit.t <= ray.maxt;
        return hit;
    }

    virtual ref<Base> member(size_t index);

    /// Weights of a triangle's vertices where a ray that just misses it comes nearest.
    ScalarPoint2f nearest(uint32_t child, uint32_t triangle, const Ray3f &ray) const {
        if (!mesh(child))
            return 0;
        bsp::Vec3f corners[3];
        get_corners(child, triangle, corners);
        return nearest_weights(corners, ray);
    }

    /// Another number whenever the accelerator has become another one.
    uint64_t build_number() const { return m_build; }

    Base *child(size_t index) const { return const_cast<Base *>(m_children[index].get()); }
    size_t child_count() const { return m_children.size(); }

    MemberRole role(size_t index) const {
        if (!has_both())
            return index == 0 ? MemberRole::all : MemberRole::stand_in;
        return index == m_first_surface   ? MemberRole::surfaces
               : index == m_first_emitter ? MemberRole::emitters
                                          : MemberRole::stand_in;
    }

    /// The shape that the scene lists for a child: its member, or while there is none the child itself.
    const Base *listed_shape(size_t index) const {
        return m_members[index] ? m_members[index] : m_children[index].get();
    }
    void list_member(size_t index, const Base *member) { m_members[index] = member; }
    void forget_member(size_t index, const Base *member) {
        if (m_members[index] == member)
            m_members[index] = nullptr;
    }

    /// What Embree is told about a carrier; invalid if it has no triangles.
    ScalarBoundingBox3f padded_bbox(MemberRole role) const;
    /// A child was edited: every group that holds it builds its accelerator again before the next ray. Throws if the
    /// new geometry is wrong; then such a group has no triangles until another edit has put that right.
    static void geometry_changed(const Base *child);
    void rebuild_if_changed() {
        if (m_changed && std::find(m_broken.begin(), m_broken.end(), true) == m_broken.end())
            rebuild();
    }
    std::string describe_self() const;

    std::vector<ref<Object>> expand() const override {
        std::vector<ref<Object>> members, listed;
        for (size_t i = 0; m_expand && i < m_children.size(); ++i)
            members.push_back(const_cast<Group *>(this)->member(i).get());
        for (size_t i = 0; m_expand && i < m_listed.size(); ++i)
            listed.push_back(members[m_listed[i]]);
        return listed;
    }

    // -- an empty group stays in the scene as it is -----------------------------------------------------------------

    ScalarSize primitive_count() const override { return 0; }
    ScalarBoundingBox3f bbox() const override { return ScalarBoundingBox3f(); }
    void describe(ShapeIR &ir) const override {
        if (!m_children.empty())
            Throw("a group with expand=false is seen only through its members, the bspmember shapes");
        Base::describe(ir);
    }
    std::string to_string() const override { return describe_self(); }

protected:
    /// `several`: shapes other than meshes may have more than one primitive.
    Group(const Properties &props, bool several);
    ~Group();

    /// Takes over the geometry of all children, in order, and builds.
    virtual void build() = 0;
    /// Forgets all triangles.
    virtual void clear() = 0;
    virtual std::string spec() const = 0;

    /// To be called at the end of the constructor; again after edits.
    void rebuild() {
        static std::atomic<uint64_t> builds{0};
        build();
        m_build = ++builds;
        m_changed = false;
    }

    const Extent &extent(size_t index) const { return m_extents[index]; }
    std::string child_name(size_t index) const {
        const std::string_view id = m_children[index]->id();
        return id.empty() ? "number " + std::to_string(index) : "\"" + std::string(id) + "\"";
    }

    /// Null for another shape.
    Mesh *mesh(size_t index) const { return m_meshes[index]; }

    /// One primitive of a child that is no mesh, by Mitsuba's own routine.
    Hit intersect_primitive(uint32_t child, uint32_t primitive, const Ray3f &ray) const {
        const PreliminaryIntersection3f pi = m_children[child]->ray_intersect_preliminary(ray, primitive, true);
        return pi.is_valid() ? Hit{pi.t, child, primitive, true, pi.prim_uv} : Hit{};
    }

    void get_corners(uint32_t child, uint32_t triangle, bsp::Vec3f (&corners)[3]) const {
        const Mesh &own = *mesh(child);
        const auto face = own.face_indices(triangle);
        for (size_t k = 0; k < 3; ++k) {
            const auto p = own.vertex_position(face[k]);
            corners[k] = {p.x(), p.y(), p.z()};
        }
    }

    std::vector<ref<Base>> m_children; ///< each once

private:
    /// A mesh may be in several groups, for example in the scene and in one of its shape groups.
    struct Alive {
        std::mutex mutex;
        std::vector<Group *> groups;
    };
    static Alive &alive() {
        static Alive &groups = *new Alive; // never destroyed, for who knows when the last group goes
        return groups;
    }

    /// A ray and its answer, for as long as the accelerator stays what it is.
    struct Answer {
        uint64_t build = 0; ///< number of the build that answered
        RayNumbers ray;
        ScalarFloat maxt = 0;
        Hit hit;
    };

    bool emits(size_t index) const { return m_children[index]->is_emitter(); }
    bool has_both() const { return m_first_emitter < m_children.size() && m_first_surface < m_children.size(); }
    void take_child(Base *shape, const std::string &name, const Properties &props);
    void measure_again(size_t index);
    Extent measure(size_t index) const;
    void prepare_texture_sampling(size_t index) const;

    bool m_several, m_expand, m_changed = false;
    std::vector<Mesh *> m_meshes; ///< the children, null for those that are none
    uint64_t m_build = 0;
    size_t m_first_emitter, m_first_surface; ///< number of children if there is none
    std::vector<size_t> m_listed;            ///< children in the order in which they were given, some of them twice
    std::vector<Extent> m_extents;
    std::vector<bool> m_broken; ///< children whose last edit was wrong: until they are right there are no triangles
    std::vector<const Base *> m_members; ///< those alive
};

template <typename Float, typename Spectrum>
typename Group<Float, Spectrum>::ScalarBoundingBox3f Group<Float, Spectrum>::padded_bbox(MemberRole role) const {
    ScalarBoundingBox3f all, box;
    for (size_t i = 0; i < m_children.size(); ++i) {
        all.expand(m_extents[i].box);
        if (role != MemberRole::emitters || emits(i))
            box.expand(m_extents[i].box);
    }
    return padded(box, all);
}

template <typename Float, typename Spectrum>
Group<Float, Spectrum>::Group(const Properties &props, bool several)
    : m_several(several), m_expand(read_flag(props, "expand", true)) {
    this->set_id(props.id());
    for (auto &prop : props.objects()) {
        Base *shape = prop.template try_get<Base>();
        if (shape == nullptr)
            Throw("a %s takes shapes as children, but \"%s\" is none", props.plugin_name(), prop.name());
        take_child(shape, std::string(prop.name()), props);
    }
    m_first_emitter = m_first_surface = m_children.size();
    for (size_t i = m_children.size(); i-- > 0;)
        (emits(i) ? m_first_emitter : m_first_surface) = i;
    if (m_children.empty())
        Log(Warn, "the %s \"%s\" has no children: it is invisible", props.plugin_name(), props.id());
    const std::lock_guard<std::mutex> lock(alive().mutex);
    alive().groups.push_back(this);
}

template <typename Float, typename Spectrum> Group<Float, Spectrum>::~Group() {
    const std::lock_guard<std::mutex> lock(alive().mutex);
    auto &groups = alive().groups;
    groups.erase(std::find(groups.begin(), groups.end(), this));
}

template <typename Float, typename Spectrum> void Group<Float, Spectrum>::geometry_changed(const Base *child) {
    std::exception_ptr wrong;
    const std::lock_guard<std::mutex> lock(alive().mutex);
    for (Group *group : alive().groups) {
        const auto found = std::find(group->m_children.begin(), group->m_children.end(), child);
        if (found == group->m_children.end())
            continue;
        try {
            group->measure_again(size_t(found - group->m_children.begin()));
        } catch (...) {
            wrong = std::current_exception();
        }
    }
    if (wrong)
        std::rethrow_exception(wrong);
}

template <typename Float, typename Spectrum> void Group<Float, Spectrum>::measure_again(size_t index) {
    m_changed = true;
    m_broken[index] = true;
    try {
        m_extents[index] = measure(index);
    } catch (...) {
        m_extents[index] = {};
        clear();
        m_build = 0;
        throw;
    }
    m_broken[index] = false;
    prepare_texture_sampling(index);
}

template <typename Float, typename Spectrum> std::string Group<Float, Spectrum>::describe_self() const {
    ScalarBoundingBox3f box;
    for (const Extent &extent : m_extents)
        box.expand(extent.box);
    std::ostringstream oss;
    oss << this->class_name() << "[" << std::endl
        << "  spec = " << spec() << "," << std::endl
        << "  children = " << m_children.size() << "," << std::endl
        << "  bbox = " << string::indent(box) << "," << std::endl
        << "  statistics = " << statistics() << std::endl
        << "]";
    return oss.str();
}

template <typename Float, typename Spectrum> Extent Group<Float, Spectrum>::measure(size_t index) const {
    if (!mesh(index))
        return measure_primitives(*m_children[index], "child " + child_name(index));
    ShapeIR ir;
    m_children[index]->describe(ir);
    return measure_triangles(ir, "child " + child_name(index));
}

template <typename Float, typename Spectrum>
void Group<Float, Spectrum>::take_child(Base *shape, const std::string &name, const Properties &props) {
    if (dynamic_cast<Group *>(shape) || dynamic_cast<Member<Float, Spectrum> *>(shape))
        Throw("a %s cannot hold another accelerated group (child \"%s\"): put all shapes into one", props.plugin_name(),
              name);
    Mesh *mesh = dynamic_cast<Mesh *>(shape);
    ShapeIR ir;
    if (mesh)
        mesh->describe(ir);
    if (mesh ? ir.kind != ShapeIR::Kind::Triangles : !is_bounded_primitive(shape->class_name()))
        Throw("child \"%s\" of a %s is neither a triangle mesh nor bounded primitives: ply, obj, serialized, cube, "
              "rectangle, merge, %s shapes can be grouped, others stay outside",
              name, props.plugin_name(), bounded_primitives);
    if (!mesh && !m_several && shape->primitive_count() > 1)
        Throw(
            "child \"%s\" of a %s has %d primitives, but Mitsuba's kd-tree takes shapes of one primitive only, besides "
            "triangle meshes: it stays outside",
            name, props.plugin_name(), shape->primitive_count());
    const auto known = std::find(m_children.begin(), m_children.end(), shape);
    m_listed.push_back(size_t(known - m_children.begin()));
    if (known != m_children.end())
        return;
    const size_t index = m_children.size();
    m_children.push_back(shape);
    m_meshes.push_back(mesh);
    m_members.push_back(nullptr);
    m_extents.push_back(measure(index));
    m_broken.push_back(false);
    if (mesh && ir.face_count == 0)
        Log(Warn, "child %s of a %s has no faces: it is invisible", child_name(index), props.plugin_name());
    prepare_texture_sampling(index);
}

/// A textured area light on a mesh makes Mitsuba build a small scene over its texture coordinates when the first sample
/// is taken. In a rendering thread that deadlocks unless the mesh knows a scene that it is part of, and a child is part
/// of none: so it is done here, with a scene that serves for nothing else.
template <typename Float, typename Spectrum> void Group<Float, Spectrum>::prepare_texture_sampling(size_t index) const {
    Mesh *mesh = this->mesh(index);
    if (!mesh || !mesh->is_emitter() || !has_flag(mesh->emitter()->flags(), EmitterFlags::SpatiallyVarying) ||
        !mesh->has_vertex_texcoords() || mesh->face_count() == 0)
        return;
    const ref<Scene> scene = PluginManager::instance()->create_object<Scene>(Properties("scene"));
    mesh->set_scene(const_cast<Scene *>(scene.get()));
    mesh->eval_parameterization(Point2f(0.5f, 0.5f), +RayFlags::Minimal, true);
    mesh->set_scene(nullptr);
}

NAMESPACE_END(mitsuba)
