/// Meshes under Mitsuba's own kd-tree, without a scene and without Embree in front of it.
#pragma once

#include "../mitsuba/native_tree.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "ray_arrays.h"

namespace bindings {

class NativeScene {
public:
    using Tree = mitsuba::NativeTree<float, mitsuba::Color<float, 3>>;

    /// Mitsuba looks up the mesh of every triangle that it tests, so a scene's meshes are kept apart. All vertices must
    /// be finite. The settings must be valid; those that are missing are Mitsuba's.
    NativeScene(const std::vector<std::pair<Rows3, Faces>> &meshes, const nb::dict &settings)
        : m_tree(new Tree(to_properties(settings))) {
        for (const auto &[vertices, faces] : meshes)
            add(vertices, faces);
        if (m_tree->bbox().valid())
            m_tree->build();
    }

    float closest(const bsp::Ray &ray) const {
        return m_tree->ready() ? m_tree->template ray_intersect_scalar<false>(to_mitsuba(ray)).t : HUGE_VALF;
    }
    bool any(const bsp::Ray &ray) const {
        return m_tree->ready() && m_tree->template ray_intersect_scalar<true>(to_mitsuba(ray)).is_valid();
    }
    void count(const bsp::Ray &ray, bool any_hit, bsp::Counters &counters) const {
        if (any_hit)
            m_tree->count<true>(to_mitsuba(ray), counters);
        else
            m_tree->count<false>(to_mitsuba(ray), counters);
    }
    std::vector<std::pair<const void *, std::size_t>> memory() const { return m_tree->memory(); }

private:
    static mitsuba::Properties to_properties(const nb::dict &settings) {
        mitsuba::Properties properties("nativekdtree");
        for (const auto &[key, value] : settings) {
            const std::string name = nb::cast<std::string>(key);
            if (nb::isinstance<nb::bool_>(value))
                properties.set(name, nb::cast<bool>(value));
            else if (nb::isinstance<nb::int_>(value))
                properties.set(name, nb::cast<std::int64_t>(value));
            else
                properties.set(name, nb::cast<double>(value));
        }
        return properties;
    }

    void add(const Rows3 &vertices, const Faces &faces) {
        mitsuba::ref<Tree::Mesh> mesh =
            new Tree::Mesh("", std::uint32_t(vertices.shape(0)), std::uint32_t(faces.shape(0)));
        std::copy_n(vertices.data(), 3 * vertices.shape(0), mesh->vertex_positions_buffer().data());
        std::copy_n(faces.data(), 3 * faces.shape(0), mesh->faces_buffer().data());
        Tree::ScalarBoundingBox3f box;
        for (std::size_t i = 0; i < 3 * faces.shape(0); ++i)
            box.expand(mesh->vertex_position(faces.data()[i]));
        m_tree->add(mesh.get(), box);
    }

    static Tree::ScalarRay3f to_mitsuba(const bsp::Ray &ray) {
        return {{ray.o.x, ray.o.y, ray.o.z}, {ray.d.x, ray.d.y, ray.d.z}, ray.maxt, 0, {}};
    }

    mitsuba::ref<Tree> m_tree;
};

} // namespace bindings
