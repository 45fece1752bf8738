/// The Python extension over the two accelerators that Mitsuba itself traces with, Embree and its own kd-tree, without
/// the renderer around them: the same questions as to our trees, asked as directly.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <string>

#include "embree_scene.h"
#include "native_scene.h"
#include "replay.h"

template class mitsuba::ShapeKDTree<float, mitsuba::Color<float, 3>>;

namespace nb = nanobind;
using namespace nb::literals;
using namespace bindings;

namespace {

/// t of every ray's first hit, infinite without one.
template <typename Scene>
nb::ndarray<nb::numpy, float> closest(const Scene &scene, Rows3 origins, Rows3 directions, Values maxt) {
    const RayArrays rays(std::move(origins), std::move(directions), std::move(maxt));
    std::vector<float> t(rays.size());
    for_each_ray(rays, [&](std::size_t i, const bsp::Ray &ray) { t[i] = scene.closest(ray); });
    return to_numpy(std::move(t));
}

template <typename Scene>
nb::ndarray<nb::numpy, std::uint8_t> any(const Scene &scene, Rows3 origins, Rows3 directions, Values maxt) {
    const RayArrays rays(std::move(origins), std::move(directions), std::move(maxt));
    std::vector<std::uint8_t> found(rays.size());
    for_each_ray(rays, [&](std::size_t i, const bsp::Ray &ray) { found[i] = scene.any(ray); });
    return to_numpy(std::move(found));
}

template <typename Scene>
nb::tuple time_rays(const Scene &scene, Rows3 origins, Rows3 directions, Values maxt, bool any_hit) {
    const RayArrays rays(std::move(origins), std::move(directions), std::move(maxt));
    if (any_hit)
        return replay(rays, [&](const bsp::Ray &ray) { return float(scene.any(ray)); });
    return replay(rays, [&](const bsp::Ray &ray) { return scene.closest(ray); });
}

nb::dict count(const NativeScene &scene, Rows3 origins, Rows3 directions, Values maxt, bool any_hit) {
    const RayArrays rays(std::move(origins), std::move(directions), std::move(maxt));
    return count_rays(rays, [&](const bsp::Ray &ray, bsp::Counters &counters) { scene.count(ray, any_hit, counters); });
}

nb::list memory(nb::handle self) {
    nb::list parts;
    for (const auto &[data, size] : nb::cast<const NativeScene &>(self).memory())
        parts.append(nb::ndarray<nb::numpy, const std::uint8_t>(data, {size}, self));
    return parts;
}

template <typename Scene> nb::class_<Scene> define(nb::module_ &m, const char *name) {
    return nb::class_<Scene>(m, name)
        .def("closest", &closest<Scene>, "origins"_a, "directions"_a, "maxt"_a)
        .def("any", &any<Scene>, "origins"_a, "directions"_a, "maxt"_a)
        .def("time", &time_rays<Scene>, "origins"_a, "directions"_a, "maxt"_a, "any_hit"_a = false);
}

} // namespace

NB_MODULE(_incumbents, m) {
    m.doc() = "Embree and Mitsuba's kd-tree on arrays, for measuring. Mitsuba must have been imported before.";

    m.attr("embree_version") = RTC_VERSION_STRING;
    define<EmbreeScene>(m, "Embree")
        .def(nb::init<const Rows3 &, const Faces &, bool>(), "vertices"_a, "faces"_a, "robust"_a = false);
    define<NativeScene>(m, "Native")
        .def(nb::init<const std::vector<std::pair<Rows3, Faces>> &, nb::dict>(), "meshes"_a, "settings"_a)
        .def("count", &count, "origins"_a, "directions"_a, "maxt"_a, "any_hit"_a = false)
        .def("memory", &memory);
}
