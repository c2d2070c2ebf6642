/* echocast for C++11 and later: owners, exceptions and spans around the C functions of echocast.h. Header-only: it adds
 * nothing to the ABI, and all C functions can be used alongside it (get()).
 *
 * Objects are moved, not copied, and release what they own. Failures are thrown as echocast::error. Any number of
 * threads can use const objects at the same time.
 */
#ifndef ECHOCAST_HPP
#define ECHOCAST_HPP

#include "echocast.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <iterator>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace echocast {

/** Why a call failed; what() is the text of echocast_last_error. */
class error : public std::runtime_error {
public:
    explicit error(echocast_status status) : std::runtime_error(echocast_last_error()), status_(status) {}

    /** One of the ECHOCAST_E_ codes. */
    echocast_status status() const noexcept { return status_; }

private:
    echocast_status status_;
};

/** Throws error unless `status` is ECHOCAST_OK. */
inline void check(echocast_status status) {
    if (status != ECHOCAST_OK) throw error(status);
}

namespace detail {

template <class T, void (*Release)(T *)>
struct deleter {
    void operator()(T *handle) const noexcept { Release(handle); }
};

/** Owns one C handle. */
template <class T, void (*Release)(T *)>
class owner {
public:
    /** The handle, still owned by this object; NULL after a move. */
    T *get() const noexcept { return handle_.get(); }

    /** Gives up ownership of the handle; the caller must release it. */
    T *release() noexcept { return handle_.release(); }

    explicit operator bool() const noexcept { return handle_ != nullptr; }

protected:
    owner() = default;
    explicit owner(T *handle) : handle_(handle) {}

    /** The handle that a C function returns through its out parameter. */
    template <class Make>
    static T *made(Make make) {
        T *handle = nullptr;
        check(make(&handle));
        return handle;
    }

    /** Calls a C function that fills the object of this handle, or creates it if the handle is still NULL. */
    template <class Fill>
    void fill(Fill call) {
        T *handle = get();
        const echocast_status status = call(&handle);
        if (!*this) handle_.reset(handle);
        check(status);
    }

    std::unique_ptr<T, deleter<T, Release>> handle_;
};

/** The text that a C function writes; a first call gets its size. */
template <class Put>
std::string text(Put put) {
    std::size_t needed = 0;
    check(put(nullptr, 0, &needed));
    std::string text(needed, '\0');
    check(put(&text[0], text.size(), nullptr));
    text.pop_back();
    return text;
}

inline const char *c_str_or_null(const std::string &text) { return text.empty() ? nullptr : text.c_str(); }

/** Carries an exception thrown by a callback out of the C call that invoked it. */
struct progress_call {
    const std::function<bool(double)> *heard;
    std::exception_ptr thrown;

    static int32_t call(void *user, double fraction) {
        auto *self = static_cast<progress_call *>(user);
        try {
            return (*self->heard)(fraction) ? 0 : 1;
        } catch (...) {
            self->thrown = std::current_exception();
            return 1;
        }
    }
};

template <class T>
struct type_of;
template <>
struct type_of<float> : std::integral_constant<int32_t, ECHOCAST_TYPE_F32> {};
template <>
struct type_of<double> : std::integral_constant<int32_t, ECHOCAST_TYPE_F64> {};
template <>
struct type_of<uint8_t> : std::integral_constant<int32_t, ECHOCAST_TYPE_U8> {};
template <>
struct type_of<uint16_t> : std::integral_constant<int32_t, ECHOCAST_TYPE_U16> {};
template <>
struct type_of<uint32_t> : std::integral_constant<int32_t, ECHOCAST_TYPE_U32> {};

} // namespace detail

/** Non-owning view of contiguous elements. */
template <class T>
class span {
public:
    span() = default;
    span(T *data, std::size_t size) : data_(data), size_(size) {}

    T *data() const noexcept { return data_; }
    std::size_t size() const noexcept { return size_; }
    bool empty() const noexcept { return size_ == 0; }
    T *begin() const noexcept { return data_; }
    T *end() const noexcept { return data_ + size_; }
    T &operator[](std::size_t index) const { return data_[index]; }

private:
    T *data_ = nullptr;
    std::size_t size_ = 0;
};

/** Non-owning view of consecutive structures; those of a newer library may be longer than T. */
template <class T>
class structs {
public:
    class iterator {
    public:
        using iterator_category = std::forward_iterator_tag;
        using value_type = T;
        using difference_type = std::ptrdiff_t;
        using pointer = const T *;
        using reference = const T &;

        iterator() = default;
        iterator(const char *at, std::size_t stride) : at_(at), stride_(stride) {}

        const T &operator*() const noexcept { return *operator->(); }
        const T *operator->() const noexcept { return static_cast<const T *>(static_cast<const void *>(at_)); }
        iterator &operator++() noexcept {
            at_ += stride_;
            return *this;
        }
        iterator operator++(int) noexcept {
            const iterator before = *this;
            ++*this;
            return before;
        }
        bool operator==(const iterator &other) const noexcept { return at_ == other.at_; }
        bool operator!=(const iterator &other) const noexcept { return at_ != other.at_; }

    private:
        const char *at_ = nullptr;
        std::size_t stride_ = 0;
    };

    structs() = default;
    structs(const T *data, std::size_t size, std::size_t stride) : data_(data), size_(size), stride_(stride) {}

    std::size_t size() const noexcept { return size_; }
    bool empty() const noexcept { return size_ == 0; }
    iterator begin() const noexcept { return iterator(at(0), stride_); }
    iterator end() const noexcept { return iterator(at(size_), stride_); }
    const T &operator[](std::size_t index) const noexcept { return *iterator(at(index), stride_); }

private:
    const char *at(std::size_t index) const noexcept {
        return static_cast<const char *>(static_cast<const void *>(data_)) + index * stride_;
    }

    const T *data_ = nullptr;
    std::size_t size_ = 0;
    std::size_t stride_ = 0;
};

/** Non-owning view of pixels, row by row from the top left. */
template <class T>
class image {
public:
    image() = default;
    explicit image(const echocast_image_view &view) : view_(view) {}

    uint32_t width() const noexcept { return view_.width; }
    uint32_t height() const noexcept { return view_.height; }
    /** Values per pixel. */
    uint32_t channels() const noexcept { return view_.channels; }
    T *data() const noexcept { return static_cast<T *>(view_.data); }
    /** Bytes from row to row. */
    std::size_t row_stride() const noexcept { return view_.row_stride; }

    /** The values of a row, pixel by pixel. */
    span<T> row(uint32_t y) const noexcept {
        const char *start = static_cast<const char *>(view_.data) + y * view_.row_stride;
        return span<T>(static_cast<T *>(static_cast<const void *>(start)), std::size_t(width()) * channels());
    }

    /** One value of the pixel in column `x`, row `y`. */
    T &operator()(uint32_t x, uint32_t y, uint32_t channel = 0) const noexcept {
        return row(y)[std::size_t(x) * channels() + channel];
    }

private:
    echocast_image_view view_ = {nullptr, 0, 0, 0, 0, 0};
};

/** A pose at x, y, z metres, not rotated. */
inline echocast_pose pose_at(double x, double y, double z) {
    echocast_pose pose = ECHOCAST_POSE_IDENTITY;
    pose.m[3] = x;
    pose.m[7] = y;
    pose.m[11] = z;
    return pose;
}

/** A pose at x, y, z metres, rotated by the unit quaternion {x, y, z, w}: real part last, as in ROS. */
inline echocast_pose pose_at(double x, double y, double z, const std::array<double, 4> &xyzw) {
    const double position[] = {x, y, z};
    echocast_pose pose;
    check(echocast_pose_from_quaternion(position, xyzw.data(), &pose));
    return pose;
}

/** A camera node of a loaded file. */
struct camera {
    std::string name;
    /** The pose at time 0, with a sensor's axes (x forward). */
    echocast_pose pose;
};

/** Number of an instance in its scene. */
using instance = echocast_instance;

/** Threads and Embree's device; everything else belongs to a context. */
class context : public detail::owner<echocast_context, echocast_context_release> {
public:
    /** `threads`: 0 for one per core of the machine, 1 for the calling thread only. */
    explicit context(int threads = 0) : context(with_threads(threads)) {}

    explicit context(const echocast_context_desc &desc)
        : owner(made([&](echocast_context **out) { return echocast_context_create(&desc, out); })) {}

private:
    static echocast_context_desc with_threads(int threads) {
        echocast_context_desc desc = ECHOCAST_CONTEXT_DESC_INIT;
        desc.threads = threads;
        return desc;
    }
};

/** What surfaces are made of. */
class material : public detail::owner<echocast_material, echocast_material_release> {
public:
    /** From YAML text with the keys of a material file; `image` may be NULL. */
    material(const context &context, const std::string &yaml, const echocast_image *image = nullptr)
        : owner(made([&](echocast_material **out) {
              return echocast_material_create(context.get(), yaml.c_str(), image, out);
          })) {}
};

/** Triangles that instances place in a scene. */
class mesh : public detail::owner<echocast_mesh, echocast_mesh_release> {
public:
    mesh(const context &context, const echocast_mesh_desc &desc)
        : owner(made([&](echocast_mesh **out) { return echocast_mesh_create(context.get(), &desc, out); })) {}

    /** A mesh of one part; the vectors are copied. */
    mesh(const context &context, const std::vector<std::array<float, 3>> &positions,
         const std::vector<std::array<uint32_t, 3>> &triangles, const material *made_of = nullptr, uint32_t part_id = 0)
        : owner(made([&](echocast_mesh **out) {
              const auto counted = static_cast<uint32_t>(triangles.size());
              const echocast_part part = {0, counted, made_of ? made_of->get() : nullptr, part_id, 0};
              echocast_mesh_desc desc = ECHOCAST_MESH_DESC_INIT;
              desc.positions = positions.empty() ? nullptr : positions.data()->data();
              desc.vertex_count = static_cast<uint32_t>(positions.size());
              desc.indices = triangles.empty() ? nullptr : triangles.data()->data();
              desc.triangle_count = counted;
              desc.parts = &part;
              desc.part_count = 1;
              return echocast_mesh_create(context.get(), &desc, out);
          })) {}

    /** Builds its ray-tracing structure now rather than in the first commit. */
    void prepare() { check(echocast_mesh_prepare(get())); }
};

/** The state of a scene at a commit. */
class snapshot : public detail::owner<echocast_snapshot, echocast_snapshot_release> {
public:
    explicit snapshot(echocast_snapshot *handle) : owner(handle) {}
};

/** Instances that can be added, removed and moved. */
class scene : public detail::owner<echocast_scene, echocast_scene_release> {
public:
    explicit scene(const context &context)
        : owner(made([&](echocast_scene **out) { return echocast_scene_create(context.get(), nullptr, out); })) {}

    /** `origin`: world position that results are relative to, metres. */
    scene(const context &context, const std::array<double, 3> &origin)
        : owner(made([&](echocast_scene **out) {
              echocast_scene_desc desc = ECHOCAST_SCENE_DESC_INIT;
              desc.origin = origin.data();
              return echocast_scene_create(context.get(), &desc, out);
          })) {}

    /** Adds the contents of a scene file. */
    void load(const std::string &path, const std::string &options = "") {
        check(echocast_scene_load(get(), path.c_str(), options.c_str()));
    }

    void load_memory(const void *data, std::size_t size, const std::string &options = "") {
        check(echocast_scene_load_memory(get(), data, size, options.c_str()));
    }

    instance add(const echocast_instance_desc &desc) {
        instance id = 0;
        check(echocast_scene_add(get(), &desc, &id));
        return id;
    }

    instance add(const mesh &mesh, const echocast_pose &pose, uint32_t category_id, uint32_t instance_id,
                 const std::string &name = "") {
        echocast_instance_desc desc = ECHOCAST_INSTANCE_DESC_INIT;
        desc.mesh = mesh.get();
        desc.pose = pose;
        desc.category_id = category_id;
        desc.instance_id = instance_id;
        desc.name = detail::c_str_or_null(name);
        return add(desc);
    }

    void remove(instance id) { check(echocast_scene_remove(get(), id)); }

    instance find(const std::string &name) const {
        instance id = 0;
        check(echocast_scene_find(get(), name.c_str(), &id));
        return id;
    }

    /** All instances, in a fixed order. */
    std::vector<instance> instances() const {
        std::size_t count = 0;
        check(echocast_scene_get_instances(get(), 0, 0, nullptr, &count));
        std::vector<instance> ids(count);
        check(echocast_scene_get_instances(get(), 0, count, ids.data(), nullptr));
        return ids;
    }

    /** The properties of an instance; `name`, if given, receives its name, at most 255 bytes of it. */
    echocast_instance_info info(instance id, std::string *name = nullptr) const {
        char text[256];
        echocast_instance_info info = ECHOCAST_INSTANCE_INFO_INIT;
        info.name = text;
        info.name_capacity = sizeof text;
        check(echocast_scene_get_instance(get(), id, &info));
        if (name) *name = text;
        info.name = nullptr;
        return info;
    }

    /** The pose of a camera node of a loaded file, with a sensor's axes. */
    echocast_pose camera(const std::string &name) const {
        echocast_pose pose;
        check(echocast_scene_camera(get(), name.c_str(), &pose));
        return pose;
    }

    /** All camera nodes of the loaded files. */
    std::vector<echocast::camera> cameras() const {
        std::vector<echocast::camera> all(info().cameras);
        for (std::size_t number = 0; number < all.size(); ++number) {
            all[number].name = detail::text([&](char *to, std::size_t capacity, std::size_t *needed) {
                return echocast_scene_get_camera(get(), number, to, capacity, needed, &all[number].pose);
            });
        }
        return all;
    }

    /** The number of a label name, such as category "car". */
    uint32_t label_number(const std::string &table, const std::string &name) const {
        uint32_t number = 0;
        check(echocast_scene_label_number(get(), table.c_str(), name.c_str(), &number));
        return number;
    }

    echocast_scene_info info() const {
        echocast_scene_info info = ECHOCAST_SCENE_INFO_INIT;
        check(echocast_scene_get_info(get(), &info));
        return info;
    }

    void set_pose(instance id, const echocast_pose &pose) { check(echocast_scene_set_poses(get(), 1, &id, &pose)); }

    void set_poses(const std::vector<instance> &ids, const std::vector<echocast_pose> &poses) {
        if (ids.size() != poses.size()) throw std::invalid_argument("as many poses as instances");
        check(echocast_scene_set_poses(get(), ids.size(), ids.data(), poses.data()));
    }

    /** Moves through these poses, whose times must not decrease; see echocast_scene_set_motion. */
    void set_motion(instance id, const std::vector<echocast_pose_key> &keys) {
        check(echocast_scene_set_motion(get(), id, keys.data(), keys.size()));
    }

    /** Sets moving instances to the interval of `length_ns` from `start_ns` on; 0: they stand still. */
    void set_time(int64_t start_ns, int64_t length_ns) {
        check(echocast_scene_set_time(get(), start_ns, length_ns));
    }

    /** `normals`: empty for flat shading. */
    void set_vertices(instance id, const std::vector<std::array<float, 3>> &positions,
                      const std::vector<std::array<float, 3>> &normals = {}) {
        if (!normals.empty() && normals.size() != positions.size()) {
            throw std::invalid_argument("as many normals as positions");
        }
        check(echocast_scene_set_vertices(get(), id, positions.empty() ? nullptr : positions.data()->data(),
                                          normals.empty() ? nullptr : normals.data()->data(), positions.size()));
    }

    /** The positions of all vertices for each of `times_ns`, which must increase, one time after the other. */
    void set_vertex_motion(instance id, const std::vector<int64_t> &times_ns,
                           const std::vector<std::array<float, 3>> &positions) {
        if (times_ns.empty() || positions.size() % times_ns.size() != 0) {
            throw std::invalid_argument("as many positions for each time");
        }
        check(echocast_scene_set_vertex_motion(get(), id, times_ns.data(), times_ns.size(),
                                               positions.empty() ? nullptr : positions.data()->data(),
                                               positions.size() / times_ns.size()));
    }

    /** The labels of the parts stay as they are. */
    void set_labels(instance id, uint32_t category_id, uint32_t instance_id) {
        check(echocast_scene_set_labels(get(), id, category_id, instance_id, nullptr, 0));
    }

    void set_labels(instance id, uint32_t category_id, uint32_t instance_id, const std::vector<uint32_t> &part_ids) {
        static const uint32_t none = 0;
        check(echocast_scene_set_labels(get(), id, category_id, instance_id,
                                        part_ids.empty() ? &none : part_ids.data(), part_ids.size()));
    }

    void set_mask(instance id, uint32_t mask) { check(echocast_scene_set_mask(get(), id, mask)); }

    void set_material(instance id, const material &material) {
        check(echocast_scene_set_material(get(), id, material.get()));
    }

    /** Restores the materials of the mesh. */
    void reset_material(instance id) { check(echocast_scene_set_material(get(), id, nullptr)); }

    void name_label(const std::string &table, uint32_t number, const std::string &name) {
        check(echocast_scene_name_label(get(), table.c_str(), number, name.c_str()));
    }

    /** The current state of the scene, for scans. */
    snapshot commit() {
        return snapshot(made_snapshot());
    }

private:
    echocast_snapshot *made_snapshot() {
        echocast_snapshot *handle = nullptr;
        check(echocast_scene_commit(get(), &handle));
        return handle;
    }
};

/** A numeric parameter of a sensor and its limits. */
struct parameter {
    double value, min, max;
};

/** An instrument. */
class sensor : public detail::owner<echocast_sensor, echocast_sensor_release> {
public:
    /** From the name of a preset or the path of a sensor file. */
    sensor(const context &context, const std::string &name)
        : owner(made([&](echocast_sensor **out) { return echocast_sensor_create(context.get(), name.c_str(), out); })) {}

    static sensor from_text(const context &context, const std::string &yaml, const std::string &folder = "") {
        return sensor(made([&](echocast_sensor **out) {
            return echocast_sensor_from_text(context.get(), yaml.c_str(), folder.c_str(), out);
        }));
    }

    /** `beams`: rows * columns, row by row. */
    static sensor from_beams(const context &context, const std::string &name, uint32_t rows, uint32_t columns,
                             const std::vector<echocast_beam> &beams, int64_t period_ns,
                             int32_t firing = ECHOCAST_FIRING_BEAMS) {
        if (beams.size() != std::size_t(rows) * columns) throw std::invalid_argument("rows * columns beams");
        echocast_beams_desc desc = ECHOCAST_BEAMS_DESC_INIT;
        desc.name = name.c_str();
        desc.beams = beams.data();
        desc.rows = rows;
        desc.columns = columns;
        desc.period_ns = period_ns;
        desc.firing = firing;
        return sensor(
            made([&](echocast_sensor **out) { return echocast_sensor_from_beams(context.get(), &desc, out); }));
    }

    /** From rays in firing order: beams with their own origins and times. */
    static sensor from_rays(const context &context, const std::string &name, const std::vector<echocast_beam> &rays,
                            int64_t period_ns) {
        return from_beams(context, name, 1, static_cast<uint32_t>(rays.size()), rays, period_ns);
    }

    void set(const std::string &key, const std::string &value) {
        check(echocast_sensor_set(get(), key.c_str(), value.c_str()));
    }

    parameter get_parameter(const std::string &key) const {
        parameter found;
        check(echocast_sensor_get(get(), key.c_str(), &found.value, &found.min, &found.max));
        return found;
    }

    /** The complete sensor description, as YAML. */
    std::string describe() const {
        return detail::text([&](char *to, std::size_t capacity, std::size_t *needed) {
            return echocast_sensor_describe(get(), to, capacity, needed);
        });
    }

    echocast_sensor_info info() const {
        echocast_sensor_info info = ECHOCAST_SENSOR_INFO_INIT;
        check(echocast_sensor_get_info(get(), &info));
        return info;
    }

    std::vector<echocast_beam> beams() const {
        const echocast_sensor_info shape = info();
        std::vector<echocast_beam> all(std::size_t(shape.rows) * shape.columns);
        check(echocast_sensor_get_beams(get(), 0, all.size(), all.data()));
        return all;
    }

private:
    friend class sample;

    explicit sensor(echocast_sensor *handle) : owner(handle) {}
};

/** What a driver (such as ECHOCAST_DRIVER_VELODYNE) publishes for a point: the fields of its messages, and the columns
 *  that a scan must have. */
inline echocast_driver_info driver_info(int32_t driver) {
    echocast_driver_info info = ECHOCAST_DRIVER_INFO_INIT;
    check(echocast_driver_get_info(driver, &info));
    return info;
}

class radar;

/** Points, column by column. */
class result : public detail::owner<echocast_result, echocast_result_release> {
public:
    /** Empty until the first scan into it. */
    result() = default;

    std::size_t size() const { return get() ? echocast_result_count(get()) : 0; }

    echocast_result_info info() const {
        echocast_result_info info = ECHOCAST_RESULT_INFO_INIT;
        check(echocast_result_get_info(get(), &info));
        return info;
    }

    /** A column, without a copy, valid until the next scan into this; T is the type of the column: float, double,
     *  uint8_t, uint16_t or uint32_t. */
    template <class T>
    span<const T> column(const std::string &name) const {
        echocast_view view;
        check(echocast_result_view(get(), name.c_str(), &view));
        if (view.kind != detail::type_of<T>::value) {
            throw std::invalid_argument("the column " + name + " has another type");
        }
        return span<const T>(static_cast<const T *>(view.data), view.count);
    }

    /** The boxes around labelled instances, of scans with `boxes`, without a copy; valid until the next scan into
     *  this. */
    structs<echocast_box> boxes() const {
        echocast_box_view found;
        check(echocast_result_boxes(get(), &found));
        return structs<echocast_box>(found.data, found.count, found.stride);
    }

    /** A layer of the image of a camera or of a spinning or sweeping sensor, valid until the next scan into this; T is
     *  float, uint32_t for label numbers, or uint8_t for colours. */
    template <class T>
    echocast::image<const T> image(const std::string &layer) const {
        echocast_image_view view;
        check(echocast_result_image(get(), layer.c_str(), &view));
        if (view.kind != detail::type_of<T>::value) {
            throw std::invalid_argument("the layer " + layer + " has another type");
        }
        return echocast::image<const T>(view);
    }

    /** What the image shows of each instance, valid until the next scan into this. */
    structs<echocast_image_box> image_boxes() const {
        echocast_image_box_view found;
        check(echocast_result_image_boxes(get(), &found));
        return structs<echocast_image_box>(found.data, found.count, found.stride);
    }

    /** Points in a layout chosen by the host, `stride` bytes each. */
    std::vector<uint8_t> pack(const std::vector<echocast_pack_item> &items, std::size_t stride) const {
        std::vector<uint8_t> bytes(size() * stride);
        check(echocast_result_pack(get(), items.data(), items.size(), stride, bytes.data(), bytes.size(), nullptr));
        return bytes;
    }

    /** The same into the caller's memory of at least size() * stride bytes, without allocating: the data of a message,
     *  for instance. */
    void pack(const echocast_pack_item *items, std::size_t item_count, std::size_t stride, void *to,
              std::size_t capacity) const {
        check(echocast_result_pack(get(), items, item_count, stride, to, capacity, nullptr));
    }

    void pack(const std::vector<echocast_pack_item> &items, std::size_t stride, span<uint8_t> to) const {
        pack(items.data(), items.size(), stride, to.data(), to.size());
    }

    /** Height and width of the PointCloud2 that a driver (such as ECHOCAST_DRIVER_VELODYNE) makes of the points: for
     *  organised points those of the driver's image, else 1 and the number of points. */
    std::array<uint32_t, 2> driver_shape(int32_t driver) const {
        std::array<uint32_t, 2> shape;
        check(echocast_result_driver_shape(get(), driver, &shape[0], &shape[1]));
        return shape;
    }

    /** The points as a driver publishes them, in its order: the data of a PointCloud2 with the stamp `stamp_ns`. */
    std::vector<uint8_t> pack_driver(int32_t driver, int64_t stamp_ns) const {
        std::vector<uint8_t> bytes(size() * echocast::driver_info(driver).point_step);
        pack_driver(driver, stamp_ns, span<uint8_t>(bytes.data(), bytes.size()));
        return bytes;
    }

    void pack_driver(int32_t driver, int64_t stamp_ns, span<uint8_t> to) const {
        check(echocast_result_pack_driver(get(), driver, stamp_ns, to.data(), to.size(), nullptr));
    }

    /** The points as a serialised message of ROS 2 (such as ECHOCAST_MESSAGE_LASER_SCAN), in the frame `frame_id`. */
    std::vector<uint8_t> pack_message(int32_t message, const std::string &frame_id) const {
        size_t size = 0;
        check(echocast_result_pack_message(get(), message, frame_id.c_str(), nullptr, 0, &size));
        std::vector<uint8_t> bytes(size);
        check(echocast_result_pack_message(get(), message, frame_id.c_str(), bytes.data(), size, nullptr));
        return bytes;
    }

    /** The number of a label name, such as category "car". */
    uint32_t label_number(const std::string &table, const std::string &name) const {
        uint32_t number = 0;
        check(echocast_result_label_number(get(), table.c_str(), name.c_str(), &number));
        return number;
    }

    /** The name of a label number, "" if it has none. */
    std::string label_name(const std::string &table, uint32_t number) const {
        const char *name = echocast_result_label_name(get(), table.c_str(), number);
        return name ? name : "";
    }

    /** Appends the points of another scan. */
    void append(const result &other) { check(echocast_result_append(get(), other.get())); }

    /** `format`: empty to choose it by the ending of `path`. */
    void write(const std::string &path, const std::string &format = "") const {
        check(echocast_result_write(get(), path.c_str(), detail::c_str_or_null(format)));
    }

    /** Writes a picture. */
    void preview(const std::string &path, const std::string &options = "") const {
        check(echocast_result_preview(get(), path.c_str(), options.c_str()));
    }

private:
    friend class sample;
    friend void scan(const snapshot &, const echocast_scan_desc &, result &);
    friend void radar_frame(const snapshot &, const echocast_scan_desc &, uint32_t, radar &, result &);
};

/** Scans once, reusing the memory of `io`. */
inline void scan(const snapshot &snapshot, const echocast_scan_desc &desc, result &io) {
    io.fill([&](echocast_result **handle) { return echocast_scan(snapshot.get(), &desc, handle); });
}

/** As above; `progress` gets the fraction done and returns whether to continue. What it throws is rethrown here. */
inline void scan(const snapshot &snapshot, echocast_scan_desc desc, result &io,
                 const std::function<bool(double)> &progress) {
    detail::progress_call call = {&progress, nullptr};
    desc.progress = detail::progress_call::call;
    desc.progress_user = &call;
    try {
        scan(snapshot, desc, io);
    } catch (const error &) {
        if (call.thrown) std::rethrow_exception(call.thrown);
        throw;
    }
}

/** Scans once with a sensor that is stationary at `pose`. */
inline result scan(const snapshot &snapshot, const sensor &sensor, const echocast_pose &pose, uint64_t seed = 0) {
    const echocast_pose_key here = {0, pose};
    echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
    desc.sensor = sensor.get();
    desc.poses = &here;
    desc.pose_count = 1;
    desc.seed = seed;
    result points;
    scan(snapshot, desc, points);
    return points;
}

/** Pings of one sonar, counted from 0, usually only the last one. Spans and views are valid until the next ping into
 *  this. */
class pings : public detail::owner<echocast_pings, echocast_pings_release> {
public:
    /** Empty until the first ping into it. */
    pings() = default;

    std::size_t size() const { return get() ? echocast_pings_count(get()) : 0; }

    echocast_ping_info info(std::size_t ping = 0) const {
        echocast_ping_info info = ECHOCAST_PING_INFO_INIT;
        check(echocast_pings_get_info(get(), ping, &info));
        return info;
    }

    /** Levels in dB re 1 uPa, without a copy: beams * bins, beam by beam. */
    span<const float> levels(std::size_t ping = 0) const { return column<float>("intensity", ping); }

    /** A column, likewise; T is the type of the column: float, double, uint8_t, uint16_t or uint32_t. */
    template <class T>
    span<const T> column(const std::string &name, std::size_t ping = 0) const {
        echocast_view view;
        check(echocast_pings_view(get(), ping, name.c_str(), &view));
        if (view.kind != detail::type_of<T>::value) {
            throw std::invalid_argument("the column " + name + " has another type");
        }
        return span<const T>(static_cast<const T *>(view.data), view.count);
    }

    /** Azimuth and elevation of each beam, alternating, rad. */
    span<const float> axes(std::size_t ping = 0) const {
        const echocast_ping_info about = info(ping);
        return span<const float>(about.axes, std::size_t(2) * about.beams);
    }

    /** Lowest level that is reported as an echo, dB re 1 uPa, for each bin. */
    span<const float> threshold_db(std::size_t ping = 0) const {
        const echocast_ping_info about = info(ping);
        return span<const float>(about.threshold_db, about.bins);
    }

    /** Time-varied gain applied in pictures, dB, for each bin. */
    span<const float> tvg_db(std::size_t ping = 0) const {
        const echocast_ping_info about = info(ping);
        return span<const float>(about.tvg_db, about.bins);
    }

    /** The depths that the beams report. */
    structs<echocast_sounding> soundings(std::size_t ping = 0) const {
        echocast_sounding_view found;
        check(echocast_pings_soundings(get(), ping, &found));
        return structs<echocast_sounding>(found.data, found.count, found.stride);
    }

    /** The cells as an image with a row for each bin and a pixel of `stride` bytes for each beam, into the caller's
     *  memory, without allocating: the data of a message, for instance. */
    void pack(const echocast_pack_item *items, std::size_t item_count, std::size_t stride, void *to,
              std::size_t capacity, std::size_t ping = 0) const {
        check(echocast_pings_pack(get(), ping, items, item_count, stride, to, capacity, nullptr));
    }

    /** The same, returned as bytes. */
    std::vector<uint8_t> pack(const std::vector<echocast_pack_item> &items, std::size_t stride,
                              std::size_t ping = 0) const {
        const echocast_ping_info about = info(ping);
        std::vector<uint8_t> bytes(stride * about.beams * about.bins);
        pack(items.data(), items.size(), stride, bytes.data(), bytes.size(), ping);
        return bytes;
    }

    /** A layer of the picture of all pings that `options` select, such as "{view: fan}"; T is float for "values" and
     *  uint32_t for label columns. `place`, if not NULL, receives the coordinates of its pixels. */
    template <class T>
    echocast::image<const T> image(const std::string &options, const std::string &layer = "values",
                                   echocast_image_place *place = nullptr) const {
        echocast_image_view view;
        check(echocast_pings_image(get(), options.c_str(), layer.c_str(), &view, place));
        if (view.kind != detail::type_of<T>::value) {
            throw std::invalid_argument("the layer " + layer + " has another type");
        }
        return echocast::image<const T>(view);
    }

    /** The number of a label name, such as category "wreck". */
    uint32_t label_number(const std::string &table, const std::string &name) const {
        uint32_t number = 0;
        check(echocast_pings_label_number(get(), table.c_str(), name.c_str(), &number));
        return number;
    }

    /** The name of a label number, "" if it has none. */
    std::string label_name(const std::string &table, uint32_t number) const {
        const char *name = echocast_pings_label_name(get(), table.c_str(), number);
        return name ? name : "";
    }

    /** Appends copies of other pings. */
    void append(const pings &other) { check(echocast_pings_append(get(), other.get())); }

    /** Writes all pings as NPZ or HDF5, by the ending of `path`. */
    void write(const std::string &path) const { check(echocast_pings_write(get(), path.c_str())); }

    /** Writes a picture. */
    void preview(const std::string &path, const std::string &options) const {
        check(echocast_pings_preview(get(), path.c_str(), options.c_str()));
    }

private:
    friend class sample;
    friend void ping(const snapshot &, const echocast_scan_desc &, pings &);
};

/** Sends one ping of a sonar, reusing the memory of `io`. */
inline void ping(const snapshot &snapshot, const echocast_scan_desc &desc, pings &io) {
    io.fill([&](echocast_pings **handle) { return echocast_ping(snapshot.get(), &desc, handle); });
}

/** Sends one ping of a sonar at `pose`. */
inline pings ping(const snapshot &snapshot, const sensor &sensor, const echocast_pose &pose, uint64_t seed = 0) {
    const echocast_pose_key here = {0, pose};
    echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
    desc.sensor = sensor.get();
    desc.poses = &here;
    desc.pose_count = 1;
    desc.seed = seed;
    pings one;
    ping(snapshot, desc, one);
    return one;
}

/** The frame of a radar. Spans are valid until the next frame into this; they are empty where it has none. */
class radar : public detail::owner<echocast_radar, echocast_radar_release> {
public:
    /** Empty until the first frame into it. */
    radar() = default;

    echocast_radar_info info() const {
        echocast_radar_info info = ECHOCAST_RADAR_INFO_INIT;
        check(echocast_radar_get_info(get(), &info));
        return info;
    }

    /** Amplitudes, real and imaginary parts alternating: channels * velocities * ranges of them, range by range. */
    span<const float> cube() const {
        const echocast_radar_info about = info();
        const std::size_t cells = std::size_t(about.channels) * about.velocities * about.ranges;
        return span<const float>(about.cube, about.cube ? 2 * cells : 0);
    }

    /** Places of the virtual elements, x, y, z in turn, metres. */
    span<const double> elements() const {
        const echocast_radar_info about = info();
        return span<const double>(about.elements, std::size_t(3) * about.channels);
    }

    /** Samples, in phase and in quadrature alternating: the numbers of info().sample_shape of them. */
    span<const int16_t> samples() const {
        const echocast_radar_info about = info();
        std::size_t count = 2;
        for (uint32_t length : about.sample_shape) count *= length;
        return span<const int16_t>(about.samples, count);
    }

    /** The polar image of a rotating radar, dBm, azimuth by azimuth. */
    span<const float> polar_dbm() const {
        const echocast_radar_info about = info();
        return span<const float>(about.polar_dbm, std::size_t(about.azimuths) * about.polar_ranges);
    }

    /** Writes it as NPZ or HDF5, or its samples as of a capture card (.bin), by the ending of `path`. */
    void write(const std::string &path) const { check(echocast_radar_write(get(), path.c_str())); }

    /** Writes a picture. */
    void preview(const std::string &path, const std::string &options) const {
        check(echocast_radar_preview(get(), path.c_str(), options.c_str()));
    }

private:
    friend void radar_frame(const snapshot &, const echocast_scan_desc &, uint32_t, radar &, result &);
};

/** Simulates one frame of a radar into `io`, with what `record` requests, a sum of ECHOCAST_RADAR_ numbers, and its
 *  detections into `detections`. */
inline void radar_frame(const snapshot &snapshot, const echocast_scan_desc &desc, uint32_t record, radar &io,
                        result &detections) {
    io.fill([&](echocast_radar **frame) {
        echocast_status status = ECHOCAST_OK;
        detections.fill([&](echocast_result **points) {
            status = echocast_radar_frame(snapshot.get(), &desc, record, frame, points);
            return status;
        });
        return status;
    });
}

/** A sample of a scenario: its scene as it was drawn, and the scans of its sensors, all counted from 0. */
class sample : public detail::owner<echocast_sample, echocast_sample_release> {
public:
    /** Number of scans, one for each sensor of the rig. */
    std::size_t scans() const {
        std::size_t count = 0;
        check(echocast_sample_scans(get(), &count));
        return count;
    }

    /** Name of a scan's sensor in the rig, at most 255 bytes of it. */
    std::string name(std::size_t scan) const {
        char text[256];
        echocast_scan_info info = ECHOCAST_SCAN_INFO_INIT;
        info.name = text;
        info.name_capacity = sizeof text;
        check(echocast_sample_get_scan(get(), scan, &info));
        return text;
    }

    /** Number of frames of a scan. */
    std::size_t frames(std::size_t scan) const {
        echocast_scan_info info = ECHOCAST_SCAN_INFO_INIT;
        check(echocast_sample_get_scan(get(), scan, &info));
        return info.frames;
    }

    echocast_frame_info frame(std::size_t scan, std::size_t frame) const {
        echocast_frame_info info = ECHOCAST_FRAME_INFO_INIT;
        check(echocast_sample_get_frame(get(), scan, frame, &info));
        return info;
    }

    /** A copy of a scan's sensor. */
    sensor sensor_of(std::size_t scan) const {
        return sensor(sensor::made([&](echocast_sensor **out) { return echocast_sample_sensor(get(), scan, out); }));
    }

    /** What was drawn, as JSON. */
    std::string drawn() const {
        return detail::text([&](char *to, std::size_t capacity, std::size_t *needed) {
            return echocast_sample_drawn(get(), to, capacity, needed);
        });
    }

    /** Which boxes the following scans have: one of the ECHOCAST_BOXES_ values, and whether boxes include their place
     *  in the image. */
    void set_boxes(int32_t boxes, bool image_boxes = false) {
        check(echocast_sample_set_boxes(get(), boxes, image_boxes));
    }

    /** Scans a frame, reusing the memory of `io`; `columns`: empty for those of the scenario. */
    void scan(std::size_t scan, std::size_t frame, result &io, const std::string &columns = "") {
        io.fill([&](echocast_result **handle) {
            return echocast_sample_scan(get(), scan, frame, detail::c_str_or_null(columns), handle);
        });
    }

    /** Sends a ping of a sonar, reusing the memory of `io`; otherwise as above. */
    void ping(std::size_t scan, std::size_t frame, pings &io, const std::string &columns = "") {
        io.fill([&](echocast_pings **handle) {
            return echocast_sample_ping(get(), scan, frame, detail::c_str_or_null(columns), handle);
        });
    }

private:
    friend class scenario;

    explicit sample(echocast_sample *handle) : owner(handle) {}
};

/** A scenario, from which samples are made. */
class scenario : public detail::owner<echocast_scenario, echocast_scenario_release> {
public:
    /** From a scenario file. */
    scenario(const context &context, const std::string &path)
        : owner(made([&](echocast_scenario **out) {
              return echocast_scenario_load(context.get(), path.c_str(), out);
          })) {}

    static scenario from_text(const context &context, const std::string &yaml, const std::string &folder = "") {
        return scenario(made([&](echocast_scenario **out) {
            return echocast_scenario_from_text(context.get(), yaml.c_str(), folder.c_str(), out);
        }));
    }

    void set(const std::string &key, const std::string &value) {
        check(echocast_scenario_set(get(), key.c_str(), value.c_str()));
    }

    /** Number of samples that it defines. */
    uint64_t samples() const {
        uint64_t count = 0;
        check(echocast_scenario_samples(get(), &count));
        return count;
    }

    /** Sample `number`, the same in any order and on any thread. */
    echocast::sample sample(uint64_t number) const {
        return echocast::sample(echocast::sample::made(
            [&](echocast_sample **out) { return echocast_scenario_sample(get(), number, out); }));
    }

private:
    explicit scenario(echocast_scenario *handle) : owner(handle) {}
};

/** An HDF5 file that grows by one scan at a time. */
class frames : public detail::owner<echocast_frames, echocast_frames_release> {
public:
    frames(const context &context, const std::string &path)
        : owner(made([&](echocast_frames **out) { return echocast_frames_create(context.get(), path.c_str(), out); })) {}

    void add(const result &points) { check(echocast_frames_add(get(), points.get())); }

    /** Completes the file and gives it its name. */
    void finish() { check(echocast_frames_finish(get())); }
};

} // namespace echocast

#endif // ECHOCAST_HPP
