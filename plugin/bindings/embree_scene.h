/// One triangle mesh in Embree, by the library that Mitsuba brings along and at its best build quality.
#pragma once

#include <embree3/rtcore.h>
#include <immintrin.h>

#include <algorithm>
#include <stdexcept>

#include "ray_arrays.h"

namespace bindings {

class EmbreeScene {
public:
    EmbreeScene(const Rows3 &vertices, const Faces &faces, bool robust)
        : m_device(mitsuba::rtcNewDevice(nullptr)), m_scene(mitsuba::rtcNewScene(m_device)) {
        using namespace mitsuba;
        const RTCGeometry mesh = rtcNewGeometry(m_device, RTC_GEOMETRY_TYPE_TRIANGLE);
        void *positions = rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float),
                                                  vertices.shape(0));
        void *indices = rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                3 * sizeof(std::uint32_t), faces.shape(0));
        std::copy_n(vertices.data(), 3 * vertices.shape(0), static_cast<float *>(positions));
        std::copy_n(faces.data(), 3 * faces.shape(0), static_cast<std::uint32_t *>(indices));
        rtcSetGeometryBuildQuality(mesh, RTC_BUILD_QUALITY_HIGH);
        rtcCommitGeometry(mesh);
        rtcAttachGeometry(m_scene, mesh);
        rtcReleaseGeometry(mesh);
        rtcSetSceneFlags(m_scene, robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
        rtcSetSceneBuildQuality(m_scene, RTC_BUILD_QUALITY_HIGH);
        rtcCommitScene(m_scene);
        if (const RTCError error = rtcGetDeviceError(m_device); error != RTC_ERROR_NONE)
            throw std::runtime_error("Embree could not build its tree (error " + std::to_string(error) + ")");
    }
    ~EmbreeScene() {
        mitsuba::rtcReleaseScene(m_scene);
        mitsuba::rtcReleaseDevice(m_device);
    }
    EmbreeScene(const EmbreeScene &) = delete;
    EmbreeScene &operator=(const EmbreeScene &) = delete;

    float closest(const bsp::Ray &ray) const {
        mitsuba::RTCIntersectContext context;
        mitsuba::rtcInitIntersectContext(&context);
        mitsuba::RTCRayHit query;
        query.ray = to_embree(ray);
        query.hit.geomID = query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
        mitsuba::rtcIntersect1(m_scene, &context, &query);
        return query.hit.geomID == RTC_INVALID_GEOMETRY_ID ? HUGE_VALF : query.ray.tfar;
    }

    bool any(const bsp::Ray &ray) const {
        mitsuba::RTCIntersectContext context;
        mitsuba::rtcInitIntersectContext(&context);
        mitsuba::RTCRay query = to_embree(ray);
        mitsuba::rtcOccluded1(m_scene, &context, &query);
        return query.tfar < 0;
    }

private:
    static mitsuba::RTCRay to_embree(const bsp::Ray &ray) {
        mitsuba::RTCRay query;
        // Embree loads four floats at a time: stored one by one it would have to wait for them.
        _mm_store_ps(&query.org_x, _mm_setr_ps(ray.o.x, ray.o.y, ray.o.z, 0)); // and tnear
        _mm_store_ps(&query.dir_x, _mm_setr_ps(ray.d.x, ray.d.y, ray.d.z, 0)); // and time
        query.tfar = ray.maxt;
        query.mask = ~0u;
        query.id = query.flags = 0;
        return query;
    }

    mitsuba::RTCDevice m_device;
    mitsuba::RTCScene m_scene;
};

} // namespace bindings
