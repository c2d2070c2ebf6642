/* echocast: simulated depth sensors. C99, no other header needed.
 *
 * Generated from crates/echocast-capi by its test `header`; do not edit.
 *
 * Units are metres, radians and nanoseconds unless a name gives another. Frames are right-handed, z up; sensors look
 * along x, y is left. Strings are UTF-8 and NUL-terminated; paths are raw bytes on systems whose paths are.
 *
 * Functions return ECHOCAST_OK or an error code; echocast_last_error describes the error in a sentence. A function that
 * creates something sets *out to NULL first. Nothing here ends the process, prints, or sets a signal handler; the
 * floating-point state of the caller is restored after every call. Where file sizes are limited, the host must ignore
 * or handle SIGXFSZ; reaching the limit is then an error, like a full disk.
 *
 * What cannot be checked is undefined behaviour, as always in C: pointers that are neither NULL nor point to what the
 * function requires, arrays shorter than their count, unterminated strings, a struct_size larger than the structure,
 * memory that is freed or changed during a call. Handles are looked up and never dereferenced.
 *
 * Threads: functions that take a pointer to const only read, and any number of threads may call them for one object at
 * the same time. The other functions may be called for one object by only one thread at a time; a second thread gets
 * ECHOCAST_E_BUSY. A handle may be released on any thread, once; the object lives as long as anything uses it.
 */

#ifndef ECHOCAST_H
#define ECHOCAST_H

#include <stddef.h>
#include <stdint.h>

#if defined(_WIN32) && !defined(ECHOCAST_STATIC)
#define ECHOCAST_API __declspec(dllimport)
#elif defined(__GNUC__)
#define ECHOCAST_API __attribute__((visibility("default")))
#else
#define ECHOCAST_API
#endif

/** Version of this header: major << 24 | minor << 12 | patch; that of the library is echocast_version(). */
#define ECHOCAST_VERSION_MAJOR 0
#define ECHOCAST_VERSION_MINOR 1
#define ECHOCAST_VERSION_PATCH 0
#define ECHOCAST_VERSION                                                                                               \
    ((uint32_t)ECHOCAST_VERSION_MAJOR << 24 | (uint32_t)ECHOCAST_VERSION_MINOR << 12 | (uint32_t)ECHOCAST_VERSION_PATCH)

/** The identity pose: at the parent's origin, not rotated. */
#define ECHOCAST_POSE_IDENTITY                                                                                         \
    { { 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0 } }

/* The initial values of a structure: `echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;` */
#define ECHOCAST_CONTEXT_DESC_INIT { sizeof(echocast_context_desc), 0, 2, 0, 0 }
#define ECHOCAST_IMAGE_INIT { sizeof(echocast_image), 0, 0, 0, 3, 0, 0 }
#define ECHOCAST_SCENE_DESC_INIT { sizeof(echocast_scene_desc), 0 }
#define ECHOCAST_BEAMS_DESC_INIT { sizeof(echocast_beams_desc), 0, 0, 0, 0, 0, 0, 0 }
#define ECHOCAST_INSTANCE_INFO_INIT                                                                                    \
    { sizeof(echocast_instance_info), ECHOCAST_POSE_IDENTITY, 0, 0, 0, 0, 0, 0, 0 }
#define ECHOCAST_PART_INIT { 0, 0, 0, 0, 0 }
#define ECHOCAST_MESH_DESC_INIT { sizeof(echocast_mesh_desc), 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0 }
#define ECHOCAST_INSTANCE_DESC_INIT                                                                                    \
    { sizeof(echocast_instance_desc), 0, ECHOCAST_POSE_IDENTITY, 0, 0, 0xffffffffu, 0, 0, 0 }
#define ECHOCAST_SCENE_INFO_INIT { sizeof(echocast_scene_info), 0, 0, { 0, 0, 0 }, { 0, 0, 0 }, 0 }
#define ECHOCAST_SENSOR_INFO_INIT { sizeof(echocast_sensor_info), 0, 0, 0, 0, 0, { 0, 0 }, { 0, 0 }, 0, 0 }
#define ECHOCAST_SCAN_DESC_INIT                                                                                        \
    { sizeof(echocast_scan_desc), 0, 0, 0, 0, 0, 0, 0xffffffffu, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0 }
#define ECHOCAST_RESULT_INFO_INIT                                                                                      \
    { sizeof(echocast_result_info), 0, 0, 0, 0, 0, { 0, 0, 0 }, ECHOCAST_POSE_IDENTITY, 0, 0 }
#define ECHOCAST_DRIVER_INFO_INIT { sizeof(echocast_driver_info), 0, 0, 0, { { 0, 0, 0 } } }
#define ECHOCAST_PING_INFO_INIT                                                                                        \
    { sizeof(echocast_ping_info), 0, 0, 0, ECHOCAST_POSE_IDENTITY, { 0, 0, 0 }, 0, 0, 0, 0, 0, 0, 0, 0, 0 }
#define ECHOCAST_RADAR_INFO_INIT                                                                                       \
    { sizeof(echocast_radar_info), 0, 0, 0, ECHOCAST_POSE_IDENTITY, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, { 0, 0, 0, 0 }, 0,   \
      0, 0, 0, 0, 0, 0 }
#define ECHOCAST_SCAN_INFO_INIT { sizeof(echocast_scan_info), 0, 0, 0 }
#define ECHOCAST_FRAME_INFO_INIT { sizeof(echocast_frame_info), 0, 0, 0, 0 }

/** Structure `index` of a view of structures of `type`: `ECHOCAST_AT(echocast_box, boxes, 2)->points`. */
#define ECHOCAST_AT(type, view, index)                                                                                 \
    ((const type *)(const void *)((const char *)(view).data + (size_t)(index) * (view).stride))

#ifdef __cplusplus
extern "C" {
#endif

/* -- Errors ---------------------------------------------------------------------------------------------------------- */

/** Done. */
#define ECHOCAST_OK 0

/** An argument is not allowed. */
#define ECHOCAST_E_ARGUMENT 1

/** The object can no longer be used: a call on it failed halfway because of a defect of the library. */
#define ECHOCAST_E_STATE 2

/** A handle or the number of an instance is invalid: released, of another kind or of another context. */
#define ECHOCAST_E_HANDLE 3

/** Out of memory, or of threads. */
#define ECHOCAST_E_MEMORY 4

/** A file could not be read or written: it is missing, not permitted, the disk is full. */
#define ECHOCAST_E_IO 5

/** A file or text does not have the expected contents. */
#define ECHOCAST_E_PARSE 6

/** This build cannot do it. */
#define ECHOCAST_E_UNSUPPORTED 7

/** The progress callback ended the scan. */
#define ECHOCAST_E_CANCELLED 8

/** The object is in use: by another thread, or by the call whose callback this call comes from. 9 is reserved. */
#define ECHOCAST_E_BUSY 10

/** A structure from a header newer than this library has something set that the library does not know. */
#define ECHOCAST_E_VERSION 11

/** A defect of the library; please report the text. */
#define ECHOCAST_E_INTERNAL 99

/** The result of a call. The numbers never change and are never reused; more may be added. */
typedef int32_t echocast_status;

/**
 * Why this thread's last failed call failed: one sentence that names the argument, what it was and what is allowed. ""
 * if none failed.
 *
 * Valid until the next call on this thread that fails, or its end. Never NULL.
 */
ECHOCAST_API const char *echocast_last_error(void);

/**
 * What a status means, in a few words.
 *
 * Static, never NULL.
 */
ECHOCAST_API const char *echocast_status_string(echocast_status status);

/* -- The library ----------------------------------------------------------------------------------------------------- */

/** Version of the loaded library: major << 24 | minor << 12 | patch. That of the header is ECHOCAST_VERSION. */
ECHOCAST_API uint32_t echocast_version(void);

/**
 * The version and the optional features of this build as text: "echocast 0.1.0 (fbx, hdf5, mcap)".
 *
 * Static, never NULL.
 */
ECHOCAST_API const char *echocast_version_string(void);

/**
 * Whether the library has a feature: a format that clouds are written in ("las", "hdf5") or scenes are read from
 * ("gltf", "obj", "fbx"), a column ("true_range"). 1 or 0; 0 for unknown names and for NULL.
 */
ECHOCAST_API int32_t echocast_has_feature(const char *name);

/**
 * Names that functions accept, one by one: `list` is "presets" (sensors), "columns", "formats" (of clouds),
 * "scene_formats"; `index` counts from 0. NULL after the last, and for an unknown list.
 *
 * Static: valid as long as the library is loaded.
 *
 * ```c
 * const char *name;
 * for (size_t i = 0; (name = echocast_name("presets", i)) != NULL; ++i)
 *     puts(name);
 * ```
 */
ECHOCAST_API const char *echocast_name(const char *list, size_t index);

/* -- Contexts -------------------------------------------------------------------------------------------------------- */

/** No messages. 1 is reserved. */
#define ECHOCAST_LOG_OFF 0

/** Done, but something was left out or looks wrong. */
#define ECHOCAST_LOG_WARN 2

/** What was done. */
#define ECHOCAST_LOG_INFO 3

/** Threads and Embree's device; everything else belongs to a context. Contexts are independent of each other. */
typedef struct echocast_context echocast_context;

/**
 * Receives a message of one sentence, valid during the call. It may be called on any thread, on several at once, and
 * must neither throw nor call the library.
 */
typedef void (*echocast_log_fn)(void *user, int32_t level, const char *text);

/** Options of a context; ECHOCAST_CONTEXT_DESC_INIT has the defaults. */
typedef struct echocast_context_desc {
    /** sizeof(echocast_context_desc). */
    size_t struct_size;
    /**
     * Threads that scan, up to 1024: the calling thread, which needs 256 KiB of stack, and threads of the context,
     * which help all callers at once, those with the fewest rays first. 0 for as many as the machine has cores, 1 for
     * the calling thread only. One fewer, up to one per core, help to build large meshes. All are started with the
     * context; neither the library nor Embree's TBB starts threads later.
     */
    int32_t threads;
    /** Least important messages for `log`: an ECHOCAST_LOG_ number. */
    int32_t log_level;
    /** Receives messages; may be NULL. */
    echocast_log_fn log;
    /** First argument of `log`. */
    void *log_user;
} echocast_context_desc;

/**
 * Creates a context: starts its threads, which inherit the signal mask of the calling thread, and loads Embree. A
 * process forked afterwards does not have these threads: create contexts after a fork. `desc`: NULL for the defaults.
 * `*out` is the new context; release it with echocast_context_release.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_UNSUPPORTED (Embree is not found, or is too old, or the processor is),
 * ECHOCAST_E_MEMORY (out of memory, or of threads). Any thread may call this.
 */
ECHOCAST_API
echocast_status echocast_context_create(const echocast_context_desc *desc,
                                        echocast_context **out);

/**
 * Releases a context. What was made with it stays usable; its threads end when the last of these is released. NULL is
 * allowed. Any thread may call this.
 */
ECHOCAST_API void echocast_context_release(echocast_context *context);

/* -- Materials ------------------------------------------------------------------------------------------------------- */

/** What surfaces are made of; immutable. */
typedef struct echocast_material echocast_material;

/** An image on a surface: rows from the top, 8 bits per channel, colours sRGB-encoded; ECHOCAST_IMAGE_INIT is empty. */
typedef struct echocast_image {
    /** sizeof(echocast_image). */
    size_t struct_size;
    /** The pixels; copied by the call. */
    const uint8_t *data;
    /** Pixels per row, 1 to 16384. */
    uint32_t width;
    /** Rows, 1 to 16384. */
    uint32_t height;
    /** 3 for RGB, 4 for RGBA. */
    uint32_t channels;
    /** 0. */
    uint32_t reserved;
    /** Bytes from row to row; 0 for width * channels. */
    size_t row_stride;
} echocast_image;

/**
 * Creates a material from YAML text with the keys of a material file: `name`, `base_color`, `reflectance` and so on.
 * `image` multiplies its base colour where the mesh has texture coordinates; NULL for none.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_PARSE (line and key), ECHOCAST_E_MEMORY. Any thread may call this.
 *
 * ```c
 * echocast_material *paint;
 * echocast_material_create(context, "{name: paint, base_color: [0.8, 0.1, 0.1], reflectance: 0.6}", NULL, &paint);
 * ```
 */
ECHOCAST_API
echocast_status echocast_material_create(const echocast_context *context,
                                         const char *yaml,
                                         const echocast_image *image,
                                         echocast_material **out);

/** Releases a material; meshes and instances that use it keep it. NULL is allowed. Any thread may call this. */
ECHOCAST_API void echocast_material_release(echocast_material *material);

/* -- Meshes ---------------------------------------------------------------------------------------------------------- */

/** The arrays of the mesh are copied by the call. */
#define ECHOCAST_MESH_COPY 0

/** The arrays of the mesh remain the host's, which must neither change nor free them before `released` is called. */
#define ECHOCAST_MESH_BORROW 1

/** Triangles that instances place in a scene; immutable. */
typedef struct echocast_mesh echocast_mesh;

/**
 * Consecutive triangles of one mesh that have one material and one part label; ECHOCAST_PART_INIT has the
 * defaults.
 */
typedef struct echocast_part {
    /** The first triangle. */
    uint32_t first_triangle;
    /** Number of triangles. */
    uint32_t triangle_count;
    /** Material; NULL for the default material. */
    const echocast_material *material;
    /** Number in the column part_id; 0 = unlabelled. */
    uint32_t part_id;
    /** 0. */
    uint32_t reserved;
} echocast_part;

/** A mesh; ECHOCAST_MESH_DESC_INIT has the defaults. */
typedef struct echocast_mesh_desc {
    /** sizeof(echocast_mesh_desc). */
    size_t struct_size;
    /** Positions of the vertices, x, y, z in metres, -1e18 to 1e18, in the frame of the mesh. */
    const float *positions;
    /** Bytes from vertex to vertex, a multiple of 4; 0 means 12, which is required for borrowed positions. */
    size_t position_stride;
    /** Vertices, 1 to 4294967294. */
    uint32_t vertex_count;
    /** Triangles, 1 to 4294967294. */
    uint32_t triangle_count;
    /** Three vertex indices per triangle. */
    const uint32_t *indices;
    /** A shading normal of length 1 for each vertex; NULL for flat triangles. */
    const float *normals;
    /** Texture coordinates u, v of each vertex, v down from the top of the image; NULL without an image. */
    const float *uvs;
    /** Parts that cover all triangles in order; NULL for one part with the default material and no label. */
    const echocast_part *parts;
    /** Number of parts. */
    uint32_t part_count;
    /** ECHOCAST_MESH_COPY or ECHOCAST_MESH_BORROW. */
    int32_t ownership;
    /**
     * Called once, on any thread, when nothing uses borrowed arrays any more (not for copied ones): the mesh and
     * everything made with it have been released. It must neither throw nor call the library. Not called if the mesh
     * could not be created. May be NULL.
     */
    void (*released)(void *user);
    /** Argument of `released`. */
    void *released_user;
    /** Name, for messages; NULL for none. */
    const char *name;
} echocast_mesh_desc;

/**
 * Creates a mesh. Its acceleration structure is built when an instance is first committed, or by
 * echocast_mesh_prepare.
 *
 * Errors: ECHOCAST_E_ARGUMENT (the vertex, index or part that is wrong), ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY. Any
 * thread may call this, even while scenes are edited.
 *
 * ```c
 * static const float corners[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
 * static const uint32_t indices[] = {0, 1, 2};
 * echocast_mesh_desc desc = ECHOCAST_MESH_DESC_INIT;
 * desc.positions = corners; desc.vertex_count = 3;
 * desc.indices = indices;   desc.triangle_count = 1;
 * echocast_mesh *mesh;
 * echocast_mesh_create(context, &desc, &mesh);
 * ```
 */
ECHOCAST_API
echocast_status echocast_mesh_create(const echocast_context *context,
                                     const echocast_mesh_desc *desc,
                                     echocast_mesh **out);

/**
 * Builds the acceleration structure of the mesh, which the first commit of an instance would otherwise build.
 *
 * Errors: ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY. Any thread may call this, even while scenes are edited.
 */
ECHOCAST_API echocast_status echocast_mesh_prepare(const echocast_mesh *mesh);

/** Releases a mesh; instances keep it. NULL is allowed. Any thread may call this. */
ECHOCAST_API void echocast_mesh_release(echocast_mesh *mesh);

/* -- Poses ----------------------------------------------------------------------------------------------------------- */

/** Points are in the world frame. */
#define ECHOCAST_COORDINATES_WORLD 0

/** Points are in the sensor frame at the time of their own firing, as a driver reports them. */
#define ECHOCAST_COORDINATES_SENSOR 1

/**
 * A placement: the upper three rows of the 4x4 matrix, row after row, that takes points of the child (an instance, a
 * sensor) to the parent (the world); the fourth column is the position in metres. Instances may be scaled, sheared and
 * mirrored; sensors are only rotated and translated.
 */
typedef struct echocast_pose {
    /** Row after row. */
    double m[12];
} echocast_pose;

/** A pose at a time. */
typedef struct echocast_pose_key {
    /** Time, ns. */
    int64_t t_ns;
    /** Where the sensor or instance is at that time, in the world. */
    echocast_pose pose;
} echocast_pose_key;

/**
 * Makes a pose from a position, metres, and a unit quaternion x, y, z, w: the real part last, as in ROS. The
 * quaternion is normalised.
 *
 * Errors: ECHOCAST_E_ARGUMENT (numbers that are not finite, a quaternion whose length is not near 1). Any thread may
 * call this.
 */
ECHOCAST_API
echocast_status echocast_pose_from_quaternion(const double *position,
                                              const double *xyzw,
                                              echocast_pose *pose);

/* -- Scenes and snapshots -------------------------------------------------------------------------------------------- */

/** Instances that are added, removed and moved. One thread at a time may edit it; another gets ECHOCAST_E_BUSY. */
typedef struct echocast_scene echocast_scene;

/** A scene as it was when it was committed; immutable. Any number of threads may scan it. */
typedef struct echocast_snapshot echocast_snapshot;

/** A new scene; ECHOCAST_SCENE_DESC_INIT has the defaults. */
typedef struct echocast_scene_desc {
    /** sizeof(echocast_scene_desc). */
    size_t struct_size;
    /**
     * World position, three numbers, metres, that the single-precision coordinates of results are relative to. NULL:
     * the first commit with an instance chooses it, the world's own origin for scenes within a kilometre of it. For
     * survey coordinates, choose one near the vehicle: 8 km from it, coordinates are rounded to half a millimetre.
     */
    const double *origin;
} echocast_scene_desc;

/** The contents of a scene; ECHOCAST_SCENE_INFO_INIT is empty. */
typedef struct echocast_scene_info {
    /** sizeof(echocast_scene_info). */
    size_t struct_size;
    /** Number of instances. */
    size_t instances;
    /** Number of triangles, each mesh counted as often as it is placed. */
    size_t triangles;
    /** Lowest corner of the box around all instances, in the world, metres; all 0 without instances. */
    double low[3];
    /** Highest corner of that box. */
    double high[3];
    /** Number of camera nodes of the loaded files. */
    size_t cameras;
} echocast_scene_info;

/**
 * Creates a scene without instances. `desc`: NULL for the defaults.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE. Any thread may call this.
 */
ECHOCAST_API
echocast_status echocast_scene_create(const echocast_context *context,
                                      const echocast_scene_desc *desc,
                                      echocast_scene **out);

/** Releases a scene; its snapshots stay. NULL is allowed. Any thread may call this. */
ECHOCAST_API void echocast_scene_release(echocast_scene *scene);

/**
 * Adds the contents of a scene file (glTF, GLB, OBJ, FBX): its objects as fixed instances with their labels, and its
 * cameras. `options`: NULL, or YAML with `up` (y or z) and `scale` (metres per unit) for formats that do not define
 * them; `labels`, a label file, its contents or the name of built-in rules (`street`); `texture_limit_mib` (1024), the
 * most memory for all images; `animation`, the name of the only one to play instead of all; `loop` (false), whether
 * animations start again at their ends; and `allow_outside_paths` (false), whether the scene may refer to files
 * outside of its own folder. Categories and parts whose name is already in the scene get its number there; instances
 * are numbered on from the greatest number that has a name, from 1 if there is none.
 *
 * Errors: ECHOCAST_E_IO, ECHOCAST_E_PARSE (file and place), ECHOCAST_E_UNSUPPORTED, ECHOCAST_E_ARGUMENT,
 * ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY; the scene is then unchanged.
 *
 * ```c
 * echocast_scene_load(scene, "street.glb", "labels: {numbers: {car: 10, road: 40}}");
 * ```
 */
ECHOCAST_API echocast_status echocast_scene_load(echocast_scene *scene, const char *path, const char *options);

/** Like echocast_scene_load, from the bytes of a GLB file, or of a glTF file with embedded buffers and images. */
ECHOCAST_API
echocast_status echocast_scene_load_memory(echocast_scene *scene,
                                           const void *data,
                                           size_t size,
                                           const char *options);

/**
 * Gets the pose of a camera node of a loaded file by its name, as the pose of a sensor: x along its view, z up.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such name; similar ones are listed), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_scene_camera(const echocast_scene *scene,
                                      const char *name,
                                      echocast_pose *out);

/**
 * Gets the name of camera node `number` of the loaded files, counted from 0, and its pose at time 0, as the pose of a
 * sensor; echocast_scene_get_info gives their number. `name` has room for `capacity` bytes, a longer name is cut off;
 * `*needed`: bytes of the whole name, including the 0 at its end. One of `name` and `needed` may be NULL, and so may
 * `pose`.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_scene_get_camera(const echocast_scene *scene,
                                          size_t number,
                                          char *name,
                                          size_t capacity,
                                          size_t *needed,
                                          echocast_pose *pose);

/**
 * Gets the number of a label by its name. `table`: "category", "part", "material" or "instance", of which the first
 * with the name counts.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such name; similar ones are listed), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_scene_label_number(const echocast_scene *scene,
                                            const char *table,
                                            const char *name,
                                            uint32_t *number);

/**
 * Gets the contents of a scene. The caller sets struct_size of `*info`.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_scene_get_info(const echocast_scene *scene,
                                        echocast_scene_info *info);

/**
 * Sets the time span of the next snapshots: in them, everything that moves by itself, by the animations of files,
 * echocast_scene_set_motion or echocast_scene_set_vertex_motion, has its motion from `start_ns` to
 * `start_ns + length_ns`. A scan of such a snapshot must be within that span. With a length of 0 everything stands
 * still where it is at `start_ns`, whatever the time of a scan; a new scene stands still at time 0.
 *
 * Errors: ECHOCAST_E_ARGUMENT (a negative length), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API echocast_status echocast_scene_set_time(echocast_scene *scene, int64_t start_ns, int64_t length_ns);

/**
 * Names a number in a label column; files contain the names. `table`: "category", "part" or "instance".
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_scene_name_label(echocast_scene *scene,
                                          const char *table,
                                          uint32_t number,
                                          const char *name);

/**
 * Builds what has changed. `*out` is a snapshot of the scene as it is now, which can be scanned while the scene is
 * edited further; release it with echocast_snapshot_release.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY.
 */
ECHOCAST_API echocast_status echocast_scene_commit(echocast_scene *scene, echocast_snapshot **out);

/** Releases a snapshot. NULL is allowed. Any thread may call this. */
ECHOCAST_API void echocast_snapshot_release(echocast_snapshot *snapshot);

/* -- Instances ------------------------------------------------------------------------------------------------------- */

/** A new instance; ECHOCAST_INSTANCE_DESC_INIT has the defaults. */
typedef struct echocast_instance_desc {
    /** sizeof(echocast_instance_desc). */
    size_t struct_size;
    /** Its mesh, from the scene's context. */
    const echocast_mesh *mesh;
    /** Where it is in the world. */
    echocast_pose pose;
    /** Number in the column category_id; 0 = unlabelled. */
    uint32_t category_id;
    /**
     * Number in the column instance_id; 0 = unlabelled. Instances may share a number; the first to have it
     * names it.
     */
    uint32_t instance_id;
    /** Scans whose mask shares a bit with this see it; not 0. */
    uint32_t mask;
    /**
     * 1: it does not move. Fixed instances with a mesh of their own are built together, which is the fastest to trace;
     * whenever one is added, removed or changed, all are rebuilt. 0: it may move, at a cost of a few microseconds per
     * commit.
     */
    int32_t fixed;
    /** Replaces the materials of the mesh; NULL to keep them. */
    const echocast_material *material;
    /** Name, for echocast_scene_find, messages and the table of instances in files; NULL for none. */
    const char *name;
} echocast_instance_desc;

/** An instance of a mesh in a scene: a number that is never reused. 0 means none. */
typedef uint64_t echocast_instance;

/** The current state of an instance; ECHOCAST_INSTANCE_INFO_INIT is empty. */
typedef struct echocast_instance_info {
    /** sizeof(echocast_instance_info). */
    size_t struct_size;
    /** Where it is in the world. */
    echocast_pose pose;
    /** Number in the column category_id. */
    uint32_t category_id;
    /** Number in the column instance_id. */
    uint32_t instance_id;
    /** Scans whose mask shares a bit with this see it. */
    uint32_t mask;
    /** Parts of its mesh. */
    uint32_t part_count;
    /** Triangles of its mesh. */
    size_t triangle_count;
    /** Buffer for its name, which ends in 0 and is cut off if it is too long; NULL if not needed. Set by the caller. */
    char *name;
    /** Capacity of `name`, bytes. Set by the caller. */
    size_t name_capacity;
} echocast_instance_info;

/**
 * Adds an instance of a mesh. `*out` is its number; `out` may be NULL.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY; the scene is then unchanged.
 *
 * ```c
 * echocast_instance_desc desc = ECHOCAST_INSTANCE_DESC_INIT;
 * desc.mesh = car_mesh;
 * desc.category_id = 10;
 * desc.instance_id = 1;
 * desc.name = "car 1";
 * echocast_instance car;
 * echocast_scene_add(scene, &desc, &car);
 * ```
 */
ECHOCAST_API
echocast_status echocast_scene_add(echocast_scene *scene,
                                   const echocast_instance_desc *desc,
                                   echocast_instance *out);

/**
 * Removes an instance. Its number is never reused.
 *
 * Errors: ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API echocast_status echocast_scene_remove(echocast_scene *scene, echocast_instance id);

/**
 * Finds the first instance with a name; instances of loaded files keep their names.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such name; similar ones are listed), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API echocast_status echocast_scene_find(const echocast_scene *scene, const char *name, echocast_instance *out);

/**
 * Writes the numbers of instances to `ids`, which has room for `capacity` of them, in a fixed order, starting at index
 * `first`. `*count` (may be NULL): the total number of instances.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_scene_get_instances(const echocast_scene *scene,
                                             size_t first,
                                             size_t capacity,
                                             echocast_instance *ids,
                                             size_t *count);

/**
 * Gets the state of an instance. The caller sets struct_size of `*info`, and the buffer for its name.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_scene_get_instance(const echocast_scene *scene,
                                            echocast_instance id,
                                            echocast_instance_info *info);

/**
 * Moves instances: `ids[i]` to `poses[i]`, all or, on an error, none. Fixed instances become movable.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_scene_set_poses(echocast_scene *scene,
                                         size_t count,
                                         const echocast_instance *ids,
                                         const echocast_pose *poses);

/**
 * Moves an instance during the scans that follow: through `count` poses at times that never decrease, between which it
 * moves in straight lines and rotates uniformly; before the first and after the last it stands still. Times count from
 * the same zero as echocast_scan_desc.t0_ns. The poses may scale along the instance's own axes, but not shear. The
 * keys are copied; echocast_scene_set_time selects the part of the motion that the next snapshot shows, and
 * echocast_scene_set_poses ends it.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY; the instance then moves as before.
 */
ECHOCAST_API
echocast_status echocast_scene_set_motion(echocast_scene *scene,
                                          echocast_instance id,
                                          const echocast_pose_key *keys,
                                          size_t count);

/**
 * Gives the vertices of an instance new positions: `count` times x, y, z, as many as its mesh has, and shading
 * normals, or NULL for flat triangles. It then has its own mesh; others that share the mesh keep theirs. The arrays
 * are copied. The parts of its mesh must share their vertices, as those of echocast_mesh_create do; those of files may
 * not.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY; the instance is then unchanged.
 */
ECHOCAST_API
echocast_status echocast_scene_set_vertices(echocast_scene *scene,
                                            echocast_instance id,
                                            const float *positions,
                                            const float *normals,
                                            size_t count);

/**
 * Moves the vertices of an instance during the scans that follow: `keys` rising times, ns, as for
 * echocast_scene_set_motion, and for each of them in order `count` times x, y, z, as many as its mesh has, in its own
 * frame. Between keys they move in straight lines; before the first and after the last they stand still. The triangles
 * remain the same, and are flat. The arrays are copied. The parts of its mesh must share their vertices, as for
 * echocast_scene_set_vertices, which ends the motion.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY; the instance then moves as
 * before.
 */
ECHOCAST_API
echocast_status echocast_scene_set_vertex_motion(echocast_scene *scene,
                                                 echocast_instance id,
                                                 const int64_t *times_ns,
                                                 size_t keys,
                                                 const float *positions,
                                                 size_t count);

/**
 * Sets the labels of an instance: its category, its instance number, and those of the parts of its mesh, or NULL to
 * keep these.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_scene_set_labels(echocast_scene *scene,
                                          echocast_instance id,
                                          uint32_t category_id,
                                          uint32_t instance_id,
                                          const uint32_t *part_ids,
                                          size_t part_count);

/**
 * Sets which scans see an instance: those whose mask shares a bit with `mask`, which may be 0.
 *
 * Errors: ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API echocast_status echocast_scene_set_mask(echocast_scene *scene, echocast_instance id, uint32_t mask);

/**
 * Gives an instance one material instead of those of its mesh; NULL restores those of its mesh.
 *
 * Errors: ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_scene_set_material(echocast_scene *scene,
                                            echocast_instance id,
                                            const echocast_material *material);

/* -- Sensors --------------------------------------------------------------------------------------------------------- */

/** Every beam is its own firing. */
#define ECHOCAST_FIRING_BEAMS 0

/** All beams of a column belong to one firing. */
#define ECHOCAST_FIRING_COLUMNS 1

/** All beams belong to one firing. */
#define ECHOCAST_FIRING_FRAME 2

/**
 * An instrument: its beams, its detection and its errors. Any number of threads may scan with it; only one at a time
 * may change it.
 */
typedef struct echocast_sensor echocast_sensor;

/** A beam of a sensor: a ray with its own origin, direction and time. */
typedef struct echocast_beam {
    /** Time of its firing since the start of the scan, ns. */
    int64_t t_ns;
    /** Direction in the sensor frame, of length 1: x forward, y left, z up. */
    float direction[3];
    /** Nearest range that is reported, metres. */
    float range_min_m;
    /** Farthest range that is reported, metres; 0 for the sensor's own limit only. */
    float range_max_m;
    /** Emitter index, 0 to 65535. */
    uint32_t channel;
    /** Where it starts in the sensor frame, metres; its ranges count from there. 0 for the origin of the frame. */
    float origin[3];
    /** 0. */
    uint32_t reserved;
} echocast_beam;

/** A sensor made of beams; ECHOCAST_BEAMS_DESC_INIT is empty. */
typedef struct echocast_beams_desc {
    /** sizeof(echocast_beams_desc). */
    size_t struct_size;
    /** Name. */
    const char *name;
    /**
     * rows * columns beams, row by row. Neighbours in a row should be neighbours in angle: scans are then several
     * times as fast.
     */
    const echocast_beam *beams;
    /** Rows of its range image. */
    uint32_t rows;
    /** Columns of its range image. */
    uint32_t columns;
    /** Time from the start of one scan to the start of the next, ns, above 0. */
    int64_t period_ns;
    /** How beams are grouped into firings: an ECHOCAST_FIRING_ number. */
    int32_t firing;
    /** 0. */
    int32_t reserved;
} echocast_beams_desc;

/** The shape of a sensor; ECHOCAST_SENSOR_INFO_INIT is empty. */
typedef struct echocast_sensor_info {
    /** sizeof(echocast_sensor_info). */
    size_t struct_size;
    /** Rows of its range image: channels of a spinning sensor, pixel rows of a camera, 1 for a sonar. */
    uint32_t rows;
    /** Columns of its range image. The sensor has rows * columns beams; the index of a beam is row * columns + column. */
    uint32_t columns;
    /** Time from the start of one scan to the start of the next, ns. */
    int64_t period_ns;
    /** Width of the images that echocast_result_image makes of its scans, pixels; 0 if it makes none. */
    uint32_t image_width;
    /** Height of these images, pixels. */
    uint32_t image_height;
    /** Focal lengths of a camera along columns and rows, pixels; 0 for other sensors. */
    double focal[2];
    /** Principal point of a camera, column and row; whole numbers are pixel centres, as in OpenCV. */
    double centre[2];
    /** The ROS 2 driver of its maker, which defines the numbers of rings: an ECHOCAST_DRIVER_ number; 0 if unknown. */
    int32_t driver;
    /** 0. */
    int32_t reserved;
} echocast_sensor_info;

/**
 * Creates a sensor. `sensor`: the name of a preset ("velodyne_vlp32c", see echocast_name) or the path of a sensor
 * file.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such preset; similar names are listed), ECHOCAST_E_IO, ECHOCAST_E_PARSE (file, line,
 * key). Any thread may call this.
 */
ECHOCAST_API
echocast_status echocast_sensor_create(const echocast_context *context,
                                       const char *sensor,
                                       echocast_sensor **out);

/**
 * Creates a sensor from YAML text with the contents of a sensor file. `folder`: the folder that paths in it are
 * relative to; NULL for the working folder.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_IO, ECHOCAST_E_PARSE (line and key). Any thread may call this.
 */
ECHOCAST_API
echocast_status echocast_sensor_from_text(const echocast_context *context,
                                          const char *yaml,
                                          const char *folder,
                                          echocast_sensor **out);

/**
 * Creates an ideal lidar from beams, each a ray with its own origin and time: no noise, no threshold, no range limits
 * other than those of the beams; echocast_sensor_set adds them. Rays without rows and columns form 1 row of many
 * columns.
 *
 * Errors: ECHOCAST_E_ARGUMENT (the beam that is wrong), ECHOCAST_E_MEMORY. Any thread may call this.
 */
ECHOCAST_API
echocast_status echocast_sensor_from_beams(const echocast_context *context,
                                           const echocast_beams_desc *desc,
                                           echocast_sensor **out);

/**
 * Changes a parameter: `key` is its path in the sensor file ("noise.range_sigma_m"), `value` YAML: a number, a word, a
 * list or a whole section; "null" removes an optional one.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_PARSE (key, what was found, what is allowed), ECHOCAST_E_BUSY (a scan is
 * using the sensor); the sensor is then unchanged.
 */
ECHOCAST_API echocast_status echocast_sensor_set(echocast_sensor *sensor, const char *key, const char *value);

/**
 * Reads a numeric parameter with the lowest and highest allowed value (infinite if unbounded). `value`, `min` and
 * `max` may each be NULL.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such key, or not a number), ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_sensor_get(const echocast_sensor *sensor,
                                    const char *key,
                                    double *value,
                                    double *min,
                                    double *max);

/**
 * Writes the sensor as YAML, every key that has a value, to `yaml`, which has room for `capacity` bytes; longer text
 * is cut off. `*needed`: bytes of the whole text, including the 0 at its end. One of `yaml` and `needed` may be NULL.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_sensor_describe(const echocast_sensor *sensor,
                                         char *yaml,
                                         size_t capacity,
                                         size_t *needed);

/**
 * Gets the shape of a sensor. The caller sets struct_size of `*info`.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_sensor_get_info(const echocast_sensor *sensor,
                                         echocast_sensor_info *info);

/**
 * Writes beams `first` to `first + count - 1` to `beams`, to inspect the pattern.
 *
 * Errors: ECHOCAST_E_ARGUMENT (more than there are), ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_sensor_get_beams(const echocast_sensor *sensor,
                                          size_t first,
                                          size_t count,
                                          echocast_beam *beams);

/** Releases a sensor. NULL is allowed. Any thread may call this. */
ECHOCAST_API void echocast_sensor_release(echocast_sensor *sensor);

/* -- Columns --------------------------------------------------------------------------------------------------------- */

/** 32-bit IEEE float. */
#define ECHOCAST_TYPE_F32 1

/** 64-bit IEEE float. */
#define ECHOCAST_TYPE_F64 2

/** Unsigned 8-bit number. */
#define ECHOCAST_TYPE_U8 3

/** Unsigned 16-bit number. */
#define ECHOCAST_TYPE_U16 4

/** Unsigned 32-bit number. */
#define ECHOCAST_TYPE_U32 5

/** Signed 8-bit number; for packing only. */
#define ECHOCAST_TYPE_I8 6

/** Signed 16-bit number; for packing only. */
#define ECHOCAST_TYPE_I16 7

/** Signed 32-bit number; for packing only. */
#define ECHOCAST_TYPE_I32 8

/** Signed 64-bit number; for packing only. */
#define ECHOCAST_TYPE_I64 9

/** Unsigned 64-bit number; for packing only. */
#define ECHOCAST_TYPE_U64 10

/** A column of a result or a ping, in place. */
typedef struct echocast_view {
    /** The first element; NULL if there are none. */
    const void *data;
    /** Number of elements: as many as the result has points, or the ping has cells. */
    size_t count;
    /** Bytes from element to element. */
    size_t stride;
    /** Type: ECHOCAST_TYPE_F32 to ECHOCAST_TYPE_U32. */
    int32_t kind;
    /** 0. */
    int32_t reserved;
} echocast_view;

/** A column in packed points. */
typedef struct echocast_pack_item {
    /** Name of the column. */
    const char *column;
    /** Type in the packed point: an ECHOCAST_TYPE_ number. */
    int32_t kind;
    /** Offset in the packed point, bytes. */
    uint32_t offset;
    /** Subtracted from the column's number first, in its unit: 0, or the start of the scan for times. */
    double shift;
    /** Factor for the rest: 1 (0 also means 1), or 1e9 for nanoseconds, 255 for an intensity in bytes. */
    double scale;
} echocast_pack_item;

/* -- Boxes ----------------------------------------------------------------------------------------------------------- */

/**
 * The box around a labelled instance. Position, orientation and velocity are in the frame of the points; in sensor
 * coordinates that is the sensor frame at the time of the box, or at the start of the scan if its points are deskewed.
 */
typedef struct echocast_box {
    /** Time for which the box is valid (scan_desc.box_time), ns. Times since 1970 are rounded to 0.2 microseconds. */
    int64_t t_ns;
    /** Number of the frame, as in the column `frame`. */
    uint32_t frame;
    /** The object across all frames, as in the column `track_id`. */
    uint32_t track_id;
    /** The instance, as in the column `instance_id`; never 0. */
    uint32_t instance_id;
    /** The category, as in the column `category_id`; 0 = unlabelled. */
    uint32_t category_id;
    /** Number of returns of the scan on it. */
    uint32_t points;
    /** 0. */
    uint32_t reserved;
    /** Centre of the box, x, y, z, metres; absolute, not relative to the result's origin. */
    double position[3];
    /** Size along its axes, metres. */
    double size[3];
    /** Rotation from its axes, a unit quaternion x, y, z, w. */
    double orientation_xyzw[4];
    /** Velocity of its centre over the ground, m/s. */
    double velocity[3];
    /** Visible fraction, 0 to 1: of the beams that would hit it if it were alone, the share that does. */
    double visible;
    /**
     * Left, top, right and bottom of the whole object in the image of the sensor, pixels, including what is hidden or
     * outside of the image; NaN if not requested (scan_desc.image_boxes), or if no part of it is in front of the
     * camera.
     */
    double image[4];
} echocast_box;

/**
 * The boxes of a result, in place. Those of a newer library may be longer than those of this header: ECHOCAST_AT steps
 * by the stride.
 */
typedef struct echocast_box_view {
    /** The first; NULL if there are none. */
    const echocast_box *data;
    /** Number of boxes. */
    size_t count;
    /** Bytes from one to the next. */
    size_t stride;
} echocast_box_view;

/* -- Images ---------------------------------------------------------------------------------------------------------- */

/** A layer of the image of a result or of pings, in place: rows from top to bottom, pixels from left to right. */
typedef struct echocast_image_view {
    /** The top left pixel; the channels of a pixel are contiguous, and so are the pixels of a row. */
    const void *data;
    /** Bytes from row to row. */
    size_t row_stride;
    /** Pixels per row. */
    uint32_t width;
    /** Rows. */
    uint32_t height;
    /** Numbers per pixel: 1, or 3 for colours and normals. */
    uint32_t channels;
    /** Type of the numbers: ECHOCAST_TYPE_F32, ECHOCAST_TYPE_U8 or ECHOCAST_TYPE_U32. */
    int32_t kind;
} echocast_image_view;

/** An instance as an image shows it. */
typedef struct echocast_image_box {
    /** The instance; never 0. */
    uint32_t instance_id;
    /** Category of most of its pixels; 0 = unlabelled. */
    uint32_t category_id;
    /** First column of its pixels. */
    uint32_t left;
    /** First row of its pixels. */
    uint32_t top;
    /** Columns from the first to the last that have pixels of it. */
    uint32_t width;
    /** Rows from the first to the last. */
    uint32_t height;
    /** Number of its pixels. */
    uint32_t area;
    /** 0. */
    uint32_t reserved;
    /**
     * Left, top, right and bottom of the whole object, pixels, including what is hidden or outside of the image;
     * column c reaches from c to c + 1. NaN if unknown, as without scan_desc.image_boxes.
     */
    double amodal[4];
    /** Fraction of the area of the amodal box that is outside of the image, 0 to 1; NaN if unknown. */
    double truncation;
    /** Fraction of it that is hidden by what is in front of it, 0 to 1; NaN if unknown, as without scan_desc.boxes. */
    double occlusion;
} echocast_image_box;

/**
 * The boxes in the image of a result, in place. Those of a newer library may be longer than those of this header:
 * ECHOCAST_AT steps by the stride.
 */
typedef struct echocast_image_box_view {
    /** The first; NULL if there are none. */
    const echocast_image_box *data;
    /** Number of boxes. */
    size_t count;
    /** Bytes from one to the next. */
    size_t stride;
} echocast_image_box_view;

/* -- Results --------------------------------------------------------------------------------------------------------- */

/** Points, column by column. Any number of threads may read a result; only one at a time may change it. */
typedef struct echocast_result echocast_result;

/** Information on a result; ECHOCAST_RESULT_INFO_INIT is empty. */
typedef struct echocast_result_info {
    /** sizeof(echocast_result_info). */
    size_t struct_size;
    /** Points. */
    size_t count;
    /**
     * Rows of the range image, if every beam has its point (scan_desc.organised); else 0. For side-scan and imaging
     * sonars, a row is a beam and a column is a range bin.
     */
    uint32_t rows;
    /** Columns of the range image, or 0. */
    uint32_t columns;
    /** Frame of the positions: an ECHOCAST_COORDINATES_ number. */
    int32_t coordinates;
    /** Full scale of the column `intensity`: 1 or 255; 0 if it has none, as for levels in dB. */
    float intensity_full_scale;
    /**
     * World position, metres, that the columns x, y, z, true_x to true_z and corrected_x to corrected_z are
     * relative to.
     */
    double origin[3];
    /** Pose of the sensor at the start of the scan. */
    echocast_pose sensor_pose;
    /**
     * Most rays that a beam was given, apart from those behind mirrors and glass: what beam.sub_rays allows, or less
     * if scan_desc.time_budget_ns requires it; 0 for sonars.
     */
    uint32_t most_rays;
    /** 0. */
    uint32_t reserved;
} echocast_result_info;

/**
 * Gets information on a result. The caller sets struct_size of `*info`.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_result_get_info(const echocast_result *result,
                                         echocast_result_info *info);

/** The number of points; 0 for an invalid handle. */
ECHOCAST_API size_t echocast_result_count(const echocast_result *result);

/**
 * Gives access to a column without copying it. The view is valid until the result is used for another scan, appended
 * to or released.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such column, or one that was not computed), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 *
 * ```c
 * echocast_view view;
 * echocast_result_view(result, "range", &view);
 * const float *range = view.data;
 * ```
 */
ECHOCAST_API
echocast_status echocast_result_view(const echocast_result *result,
                                     const char *column,
                                     echocast_view *out);

/**
 * Writes the points in the host's layout, all at once: point i at `to + i * stride`, each column converted to its type
 * at its offset; bytes that no item covers stay unchanged. Numbers are rounded to the nearest value of the type;
 * not-a-number becomes 0 in integers. Positions are relative to the result's origin as ECHOCAST_TYPE_F32, and absolute
 * as ECHOCAST_TYPE_F64. Up to 64 items. `capacity`: size of `to`, bytes; `*needed` (may be NULL): stride * points; if
 * `to` is NULL, only that is written.
 *
 * Errors: ECHOCAST_E_ARGUMENT (a wrong item, too little room), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 *
 * ```c
 * // Positions, and the category in a byte; echocast_result_pack_driver has the layouts of ROS 2 drivers.
 * static const echocast_pack_item items[] = {
 *     {"x", ECHOCAST_TYPE_F32, 0, 0, 1}, {"y", ECHOCAST_TYPE_F32, 4, 0, 1},
 *     {"z", ECHOCAST_TYPE_F32, 8, 0, 1}, {"category_id", ECHOCAST_TYPE_U8, 12, 0, 1}};
 * echocast_result_pack(result, items, 4, 16, bytes, sizeof bytes, NULL);
 * ```
 */
ECHOCAST_API
echocast_status echocast_result_pack(const echocast_result *result,
                                     const echocast_pack_item *items,
                                     size_t item_count,
                                     size_t stride,
                                     void *to,
                                     size_t capacity,
                                     size_t *needed);

/**
 * The name of a label number. `table`: "category", "part", "material" or "instance". NULL if it has none.
 *
 * Valid until the result is used for another scan or released.
 */
ECHOCAST_API
const char *echocast_result_label_name(const echocast_result *result,
                                       const char *table,
                                       uint32_t number);

/**
 * Gets the number of a label by its name. `table`: "category", "part", "material" or "instance", of which the first
 * with the name counts.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such name; similar ones are listed), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_result_label_number(const echocast_result *result,
                                             const char *table,
                                             const char *name,
                                             uint32_t *number);

/**
 * Gives access to the boxes around the labelled instances that a scan with `boxes` sees, in place, sorted by
 * instance_id; those of appended results follow in order. Objects with the same instance_id share a box.
 * echocast_result_label_name returns the names of categories and instances. The view is valid until the result is used
 * for another scan, appended to or released.
 *
 * Errors: ECHOCAST_E_ARGUMENT (a scan without boxes), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 *
 * ```c
 * scan.boxes = ECHOCAST_BOXES_OBJECT;
 * echocast_scan(snapshot, &scan, &result);
 * echocast_box_view boxes;
 * echocast_result_boxes(result, &boxes);
 * for (size_t i = 0; i < boxes.count; ++i)
 *     printf("%u points\n", (unsigned)ECHOCAST_AT(echocast_box, boxes, i)->points);
 * ```
 */
ECHOCAST_API echocast_status echocast_result_boxes(const echocast_result *result, echocast_box_view *out);

/**
 * Gives access to a layer of the image that a camera, a spinning or a sweeping sensor sees; of several returns of a
 * beam, the nearest is shown. Beams without a return are NaN, 0 or black. Layers and the columns that they show:
 *
 * - "depth": distance along the axis of a camera (`depth`), for other sensors the slant range (`range`), metres; F32
 * - "range": slant range, metres (`range`); F32
 * - "category", "part", "instance": label numbers (`category_id`, `part_id`, `instance_id`); U32
 * - "color": base colour, sRGB (`red`, `green`, `blue`); 3 of U8
 * - "intensity": what the instrument reports (`intensity`); F32
 * - "normal": unit normals to the right, up and towards the sensor (`normal_x`, `normal_y`, `normal_z`); 3 of F32
 *
 * If the result is organised, it needs no other columns, and a layer of one column is not copied where the column of a
 * camera already is the image; if not, it also needs the columns `beam` and `range`. Other layers are made when they
 * are first requested, in memory that the result keeps for those of later scans. echocast_sensor_get_info gives the
 * size and the lens. The view is valid until the result is used for another scan, appended to or released.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such layer; a column that was not computed; scans of several sensors),
 * ECHOCAST_E_UNSUPPORTED (a sensor whose beams form no rows and columns; a sonar), ECHOCAST_E_MEMORY,
 * ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 *
 * ```c
 * scan.columns = "depth";
 * scan.organised = 1;
 * echocast_scan(snapshot, &scan, &result);
 * echocast_image_view depth;
 * echocast_result_image(result, "depth", &depth);
 * const float *metres = depth.data;
 * ```
 */
ECHOCAST_API
echocast_status echocast_result_image(const echocast_result *result,
                                      const char *layer,
                                      echocast_image_view *out);

/**
 * Gives access to the instances that the image of a result shows, in place, sorted by instance_id. They are found in
 * the layers "category" and "instance"; what is hidden comes from the boxes of the scan. The view is valid until the
 * result is used for another scan, appended to or released.
 *
 * Errors: as echocast_result_image.
 *
 * ```c
 * scan.columns = "category_id,instance_id";
 * scan.organised = 1;
 * scan.boxes = ECHOCAST_BOXES_OBJECT;
 * scan.image_boxes = 1;
 * echocast_scan(snapshot, &scan, &result);
 * echocast_image_box_view seen;
 * echocast_result_image_boxes(result, &seen);
 * for (size_t i = 0; i < seen.count; ++i)
 *     printf("%.0f %% hidden\n", 100 * ECHOCAST_AT(echocast_image_box, seen, i)->occlusion);
 * ```
 */
ECHOCAST_API
echocast_status echocast_result_image_boxes(const echocast_result *result,
                                            echocast_image_box_view *out);

/**
 * Appends the points of another scan of the same scene with the same columns, to be written to one file.
 *
 * Errors: ECHOCAST_E_ARGUMENT (a scan that does not fit), ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY;
 * nothing is then appended.
 */
ECHOCAST_API
echocast_status echocast_result_append(echocast_result *result,
                                       const echocast_result *other);

/** Releases a result. NULL is allowed. Any thread may call this. */
ECHOCAST_API void echocast_result_release(echocast_result *result);

/* -- Messages of drivers --------------------------------------------------------------------------------------------- */

/** Velodyne's driver, velodyne_pointcloud: points XYZIRT. */
#define ECHOCAST_DRIVER_VELODYNE 1

/** Ouster's driver, ouster_ros: points `original`. */
#define ECHOCAST_DRIVER_OUSTER 2

/** Hesai's driver, HesaiLidar_ROS_2.0. */
#define ECHOCAST_DRIVER_HESAI 3

/** RoboSense's driver, rslidar_sdk: points XYZIRT. */
#define ECHOCAST_DRIVER_ROBOSENSE 4

/** Livox's driver, livox_ros_driver2. */
#define ECHOCAST_DRIVER_LIVOX 5

/** Autoware's drivers: PointXYZIRCAEDT. */
#define ECHOCAST_DRIVER_AUTOWARE 6

/** A field of the points in a driver's messages, as in sensor_msgs/PointField. */
typedef struct echocast_point_field {
    /** Name. */
    const char *name;
    /** Type: an ECHOCAST_TYPE_ number. */
    int32_t kind;
    /** Offset of its first byte in the point. */
    uint32_t offset;
} echocast_point_field;

/** The points that a driver publishes; ECHOCAST_DRIVER_INFO_INIT is empty. */
typedef struct echocast_driver_info {
    /** sizeof(echocast_driver_info). */
    size_t struct_size;
    /** The columns that a scan must compute, for scan_desc.columns: "x,y,z,intensity,ring,time". */
    const char *columns;
    /** Size of a point, bytes. */
    size_t point_step;
    /** Number of fields. */
    size_t field_count;
    /** The fields. */
    echocast_point_field fields[16];
} echocast_driver_info;

/**
 * Gets the layout of the points that a driver publishes: names, types and offsets of the fields, for the message, and
 * the columns that a scan must compute. The caller sets struct_size of `*info`. Texts are static.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such driver).
 */
ECHOCAST_API echocast_status echocast_driver_get_info(int32_t driver, echocast_driver_info *info);

/**
 * Gets the height and width of the message that a driver would publish for a result: for organised results those of
 * the driver's image, in which Velodyne and RoboSense have a column for each ring and a row for each firing; otherwise
 * 1 and the number of points.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such driver), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_result_driver_shape(const echocast_result *result,
                                             int32_t driver,
                                             uint32_t *height,
                                             uint32_t *width);

/**
 * Writes the points as a driver publishes them, point i at `to + i * point_step`. Positions are in the sensor frame at
 * the start of the scan; those of a scan with ECHOCAST_COORDINATES_SENSOR and without scan_desc.deskew stay in the
 * frame of their own firing. Times count from `stamp_ns`, the stamp of the message, for drivers that do so (Velodyne,
 * Ouster, Autoware), otherwise from the start of the run; the ring is the column `ring`. Points of organised results
 * are in the order of the driver's image (echocast_result_driver_shape). All bytes are written, those outside of
 * fields as 0. Azimuth, elevation and range that were not computed are derived from the positions. `capacity`: size of
 * `to`, bytes; `*needed` (may be NULL): point_step * points; if `to` is NULL, only that is written.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such driver, a column that was not computed, too little room), ECHOCAST_E_HANDLE,
 * ECHOCAST_E_BUSY, ECHOCAST_E_MEMORY.
 *
 * ```c
 * echocast_driver_info velodyne = ECHOCAST_DRIVER_INFO_INIT;
 * echocast_driver_get_info(ECHOCAST_DRIVER_VELODYNE, &velodyne);
 * scan.columns = velodyne.columns;
 * echocast_scan(snapshot, &scan, &result);
 * echocast_result_pack_driver(result, ECHOCAST_DRIVER_VELODYNE, scan.t0_ns, bytes, sizeof bytes, NULL);
 * ```
 */
ECHOCAST_API
echocast_status echocast_result_pack_driver(const echocast_result *result,
                                            int32_t driver,
                                            int64_t stamp_ns,
                                            void *to,
                                            size_t capacity,
                                            size_t *needed);

/* -- Messages of ROS 2 ----------------------------------------------------------------------------------------------- */

/** sensor_msgs/LaserScan: the range of the first return of each beam of a LiDAR with a single ring. */
#define ECHOCAST_MESSAGE_LASER_SCAN 1

/** sensor_msgs/MultiEchoLaserScan: all returns, likewise. */
#define ECHOCAST_MESSAGE_MULTI_ECHO_LASER_SCAN 2

/** livox_ros_driver2/CustomMsg: points as Livox's driver publishes them in its own format. */
#define ECHOCAST_MESSAGE_LIVOX_CUSTOM 3

/** Xsens MTi-10: 100 measurements per second. */
#define ECHOCAST_IMU_XSENS_MTI10 1

/** VectorNav VN-200: 200 per second. */
#define ECHOCAST_IMU_VECTORNAV_VN200 2

/** Without errors: 200 per second. */
#define ECHOCAST_IMU_IDEAL 3

/**
 * Writes a result, that of one scan, as a serialised message (an ECHOCAST_MESSAGE_ number) of ROS 2, in the frame
 * `frame_id` of the sensor: CDR, little endian, with its four-byte header, as a publisher of serialised messages takes it.
 * Ranges of a LaserScan are those of the points at the angles of the beams, in the order of firing, so that a sensor that
 * turns clockwise has a negative angle_increment; a beam without a return has the range +inf and the intensity 0. Without
 * the column "beam" beams are found by "azimuth", else by the points. A CustomMsg needs the columns
 * "x,y,z,intensity,return_number,ring,time". Stamps are times of the run. `capacity`: size of `to`, bytes; `*needed` (may
 * be NULL): those of the message; if `to` is NULL, only that is written.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such message, a result that cannot be one, too little room), ECHOCAST_E_HANDLE,
 * ECHOCAST_E_BUSY, ECHOCAST_E_MEMORY.
 *
 * ```c
 * scan.columns = "range,intensity,return_number,beam";
 * echocast_scan(snapshot, &scan, &result);
 * size_t size;
 * echocast_result_pack_message(result, ECHOCAST_MESSAGE_LASER_SCAN, "laser", NULL, 0, &size);
 * unsigned char *data = malloc(size);
 * echocast_result_pack_message(result, ECHOCAST_MESSAGE_LASER_SCAN, "laser", data, size, NULL);
 * ```
 */
ECHOCAST_API
echocast_status echocast_result_pack_message(const echocast_result *result,
                                             int32_t message,
                                             const char *frame_id,
                                             void *to,
                                             size_t capacity,
                                             size_t *needed);

/**
 * Writes what an IMU measures as a serialised sensor_msgs/Imu, in the frame `frame_id` of the IMU: angular velocity, rad/s,
 * and specific force, m/s2, which at rest is 9.80665 upwards, in the IMU's axes; no orientation. `imu`: an ECHOCAST_IMU_
 * number. `number`: that of the measurement, from time 0 of the run on, and so its time: number / rate. `poses`: those of
 * the IMU around that time, at rising times; the velocity is constant between two, and its changes are spread over the
 * halves of both neighbours, so that three poses or more are needed to feel an acceleration. Errors are functions of
 * `seed` and `number`. `to`, `capacity` and `needed` are as for echocast_result_pack_message.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such IMU, no poses, times that do not rise, too little room), ECHOCAST_E_MEMORY.
 *
 * ```c
 * echocast_pose_key path[3] = {{0, poses[0]}, {period, poses[1]}, {2 * period, poses[2]}};
 * echocast_pack_imu(path, 3, ECHOCAST_IMU_XSENS_MTI10, 7, 10, "imu_link", bytes, sizeof bytes, NULL);
 * ```
 */
ECHOCAST_API
echocast_status echocast_pack_imu(const echocast_pose_key *poses,
                                  size_t pose_count,
                                  int32_t imu,
                                  uint64_t seed,
                                  int64_t number,
                                  const char *frame_id,
                                  void *to,
                                  size_t capacity,
                                  size_t *needed);

/**
 * Writes pose and velocities at `t_ns` as a serialised nav_msgs/Odometry: the pose in the frame `frame_id`, the twist in
 * the frame `child_frame_id` of what moves. `poses`: poses around that time, at rising times. `to`, `capacity` and
 * `needed` are as for echocast_result_pack_message.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no poses, times that do not rise, too little room), ECHOCAST_E_MEMORY.
 *
 * ```c
 * echocast_pose_key step[2] = {{0, poses[0]}, {period, poses[1]}};
 * echocast_pack_odometry(step, 2, period / 2, "odom", "base_link", bytes, sizeof bytes, NULL);
 * ```
 */
ECHOCAST_API
echocast_status echocast_pack_odometry(const echocast_pose_key *poses,
                                       size_t pose_count,
                                       int64_t t_ns,
                                       const char *frame_id,
                                       const char *child_frame_id,
                                       void *to,
                                       size_t capacity,
                                       size_t *needed);

/* -- Scans ----------------------------------------------------------------------------------------------------------- */

/** Points are in order of rising beam. */
#define ECHOCAST_ORDER_BEAM 0

/** Points are in order of rising time. */
#define ECHOCAST_ORDER_TIME 1

/** The physical models. */
#define ECHOCAST_PROFILE_PHYSICAL 0

/** The equations of the paper as printed. */
#define ECHOCAST_PROFILE_PAPER 1

/** The equations as computed by the paper's program. */
#define ECHOCAST_PROFILE_BLAINDER 2

/** As the profile defines. */
#define ECHOCAST_REFLECTANCE_DEFAULT 0

/** Surfaces without a given reflectance use the luminance of their linear base colour, whatever the wavelength. */
#define ECHOCAST_REFLECTANCE_LUMINANCE 1

/** Surfaces without a given reflectance use the alpha of their base colour. */
#define ECHOCAST_REFLECTANCE_ALPHA 2

/**
 * Surfaces without a given reflectance use that of the library material that their name suggests; else an estimate
 * from their base colour for the wavelength. The physical profile's default.
 */
#define ECHOCAST_REFLECTANCE_LIBRARY 3

/** No boxes. */
#define ECHOCAST_BOXES_NONE 0

/** Boxes along the axes of each object, z up as it was modelled. */
#define ECHOCAST_BOXES_OBJECT 1

/** Boxes along the axes of the frame of the points. */
#define ECHOCAST_BOXES_FRAME 2

/**
 * Boxes are valid for the time at which their objects are scanned: the mean time of the points on each, without points
 * the middle of the scan. With scan_desc.deskew, which brings points to the start of the scan: the start.
 */
#define ECHOCAST_BOX_TIME_SCAN 0

/** Boxes are valid for the start of the scan. */
#define ECHOCAST_BOX_TIME_START 1

/** Boxes are valid for the time at which the last beam of the scan fires. */
#define ECHOCAST_BOX_TIME_END 2

/**
 * Progress callback: receives the fraction of the work that is done, 0 to 1; returning anything but 0 ends the scan,
 * unless it is complete. Called on the scanning thread, every 2048 beams of each thread; not for sonars. It must not
 * throw, and the result is in use during the call.
 */
typedef int32_t (*echocast_progress_fn)(void *user, double fraction);

/** Options of a scan; ECHOCAST_SCAN_DESC_INIT has the defaults. */
typedef struct echocast_scan_desc {
    /** sizeof(echocast_scan_desc). */
    size_t struct_size;
    /** The sensor to scan with. */
    const echocast_sensor *sensor;
    /**
     * Where the sensor is: one pose, or several at rising times, between which it moves uniformly and rotates the
     * shorter way; before the first and after the last it stands still. Each beam is cast from the pose at the time of
     * its own firing.
     */
    const echocast_pose_key *poses;
    /** Number of poses, 1 or more. */
    size_t pose_count;
    /**
     * Start time of the scan, ns, from the same zero as the times of the poses. The column `time` counts from this
     * zero too, in seconds: there, times since 1970 are rounded to 0.2 microseconds.
     */
    int64_t t0_ns;
    /** Seed of all random draws: equal seeds, frames and inputs give equal bits, for any number of threads. */
    uint64_t seed;
    /** Index of the frame; it changes the random draws and fills the column `frame`. */
    uint32_t frame;
    /** Instances whose mask shares a bit with this are seen. */
    uint32_t mask;
    /**
     * Columns to compute: comma-separated names ("x,y,z,range,category_id"), "all", or NULL for the default columns
     * ("default" in a list), which include `doppler` if the sensor measures it.
     */
    const char *columns;
    /** 1: every beam has a row, with NaN or 0 if it has no return. 0: only returns have rows. */
    int32_t organised;
    /** Frame of the points: an ECHOCAST_COORDINATES_ number. */
    int32_t coordinates;
    /** Order of the points: an ECHOCAST_ORDER_ number. */
    int32_t order;
    /** Which models are used: an ECHOCAST_PROFILE_ number. */
    int32_t profile;
    /** Source of the reflectance where no material gives one: an ECHOCAST_REFLECTANCE_ number. */
    int32_t reflectance;
    /** 0. */
    int32_t reserved;
    /** Receives the progress of the scan and may end it; may be NULL. */
    echocast_progress_fn progress;
    /** First argument of `progress`. */
    void *progress_user;
    /**
     * Weather, and for sonars the water, as YAML with the keys of a scenario's section `environment` ("{rain:
     * {rate_mm_h: 10}}", "{water: {temperature_c: 8}}"), or NULL: clear air, and for sonars the sea below z =
     * 0. A text that is the same as in the result's last scan is not parsed again.
     */
    const char *environment;
    /**
     * 1: what moves stands still during the scan, where it is at t0_ns. 0: every beam hits it where it is at the
     * beam's own time.
     */
    int32_t freeze;
    /** 0. */
    int32_t reserved_2;
    /**
     * Time from one frame to the next, ns, over which the columns `flow_x` to `flow_z` are measured; 0: the sensor's
     * period.
     */
    int64_t frame_period_ns;
    /**
     * Boxes around the labelled instances, for echocast_result_boxes: an ECHOCAST_BOXES_ number. All beams are then
     * traced once more.
     */
    int32_t boxes;
    /**
     * 1: the boxes also have their extent in the image of the sensor, including what is hidden, which takes a pass
     * over every triangle: the amodal boxes of echocast_result_image_boxes.
     */
    int32_t image_boxes;
    /**
     * Time for which boxes are valid: an ECHOCAST_BOX_TIME_ number. For programs compiled before this field existed it
     * is the start, as was documented then.
     */
    int32_t box_time;
    /**
     * 1: positions and normals are brought to t0_ns: what moves is where it was then, with all points on it, and
     * ECHOCAST_COORDINATES_SENSOR is the sensor frame at that time. The other columns, including `true_x`, `true_y`
     * and `true_z`, are as of the firing of the beam. Not for sonars.
     */
    int32_t deskew;
    /**
     * Wall-clock time that the scan may take, ns; 0: no limit. Beams of as many rays as it takes (beam.sub_rays:
     * adaptive) get no more than fit into it, at least one, as found by scanning a few beams first; most_rays of
     * echocast_result_info is how many. Other sensors take what they take.
     */
    int64_t time_budget_ns;
} echocast_scan_desc;

/**
 * Scans once; a sonar sends one ping, whose echoes are the points. `*io`: NULL, which is replaced by a new result, to
 * be released with echocast_result_release; or a result, whose memory is reused: after the first few of their kind,
 * scans in beam order of lidars and depth cameras allocate nothing, whatever the sensor, in any weather and in front
 * of mirrors and glass; with a profile other than the physical one, or with boxes, they allocate some small blocks, a
 * ping of a sonar up to 20.
 *
 * Points of a sonar: for multibeam and single-beam sonars the depth of each beam; for side-scan and imaging sonars the
 * range bins with an echo. Their `intensity` is a level in dB re 1 uPa. Sonars must be in the water. echocast_ping
 * gives whole pings.
 *
 * On an error in the arguments, an existing result is unchanged; after a cancelled scan, or if memory runs out, it is
 * empty.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_CANCELLED, ECHOCAST_E_BUSY (another
 * thread uses the result, or changes the sensor). Any number of threads may scan one snapshot with one sensor, each
 * with its own result.
 *
 * ```c
 * echocast_pose_key here = {0, ECHOCAST_POSE_IDENTITY};
 * echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
 * desc.sensor = sensor;
 * desc.poses = &here;
 * desc.pose_count = 1;
 * echocast_result *result = NULL;
 * echocast_scan(snapshot, &desc, &result);
 * ```
 */
ECHOCAST_API
echocast_status echocast_scan(const echocast_snapshot *snapshot,
                              const echocast_scan_desc *desc,
                              echocast_result **io);

/* -- Pings ----------------------------------------------------------------------------------------------------------- */

/** Beams to the sides: waterfall and mosaic. */
#define ECHOCAST_SONAR_SIDESCAN 0

/** Beams side by side, down: bathymetry and the image of the water column. */
#define ECHOCAST_SONAR_SWATH 1

/** Beams side by side, ahead: fan. */
#define ECHOCAST_SONAR_FAN 2

/** One beam. */
#define ECHOCAST_SONAR_SINGLE 3

/** Like ECHOCAST_SONAR_SIDESCAN: the four beams of a Doppler velocity log, down and outwards. */
#define ECHOCAST_SONAR_JANUS 4

/**
 * Pings of one sonar in order, usually only the last one. Any number of threads may read them; only one at a time may
 * change them.
 */
typedef struct echocast_pings echocast_pings;

/** Time and pose of a ping and its layout; ECHOCAST_PING_INFO_INIT is empty. */
typedef struct echocast_ping_info {
    /** sizeof(echocast_ping_info). */
    size_t struct_size;
    /** Number of the ping: scan_desc.frame. */
    uint32_t number;
    /** Arrangement of the beams: an ECHOCAST_SONAR_ number. */
    int32_t view;
    /** Time of transmission, ns. Times since 1970 are rounded to 0.2 microseconds. */
    int64_t t_ns;
    /** Pose of the sonar in the world at that time, including the rotation of a rotating beam. */
    echocast_pose sensor_pose;
    /** World position, metres, that the columns true_x, true_y, true_z are relative to. */
    double origin[3];
    /** Number of beams. */
    uint32_t beams;
    /** Range bins of a beam. A ping has beams * bins cells; the index of a cell is beam * bins + bin. */
    uint32_t bins;
    /** Length of a bin, metres of reported slant range: bin k reaches from k * bin_m to (k + 1) * bin_m. */
    double bin_m;
    /** Sound speed that reported ranges assume, m/s. */
    double sound_speed;
    /** First bin that reports echoes: earlier ones are below the minimum range. */
    uint32_t first_bin;
    /** Noise level in a cell, dB re 1 uPa. */
    float noise_db;
    /**
     * Reported azimuth and elevation of the axis of each beam, interleaved, rad, sensor frame: 2 * beams numbers. This
     * and the following arrays are in place, like columns.
     */
    const float *axes;
    /** Lowest level that is reported as an echo, for each bin, dB re 1 uPa. */
    const float *threshold_db;
    /** Time-varied gain that pictures are drawn with, for each bin, dB; levels do not include it. */
    const float *tvg_db;
} echocast_ping_info;

/** An echo that a sonar reports as the depth of a beam. */
typedef struct echocast_sounding {
    /** Beam that received it. */
    uint32_t beam;
    /** Cell at that range, or the nearest one with an echo: beam * bins + bin. */
    uint32_t cell;
    /** Reported slant range. */
    float range;
    /** Level of the strongest cell of the echo, dB re 1 uPa. */
    float level_db;
    /** Confidence, 0 to 1; 0.5 for a standard error of 0.25 % of the range. */
    float quality;
    /**
     * Position by a ray traced through the assumed sound speed cast, relative to the origin of the ping; NaN where
     * that ray leaves the water.
     */
    float corrected[3];
} echocast_sounding;

/**
 * The soundings of a ping, in place. Those of a newer library may be longer than those of this header: ECHOCAST_AT
 * steps by the stride.
 */
typedef struct echocast_sounding_view {
    /** The first; NULL if there are none. */
    const echocast_sounding *data;
    /** Number of soundings. */
    size_t count;
    /** Bytes from one to the next. */
    size_t stride;
} echocast_sounding_view;

/** Coordinates of the pixels of an image: the centre of the pixel in column c and row r is first + {c, r} * step. */
typedef struct echocast_image_place {
    /**
     * Centre of the top left pixel: in a fan, metres to the right of the sonar and ahead of it (for a swath sonar,
     * above it); on a track, x, y in the world; in a waterfall, metres across track (starboard is positive) and the
     * index of the ping.
     */
    double first[2];
    /** Step from column to column, and from row to row. */
    double step[2];
} echocast_image_place;

/**
 * Sends one ping of a sonar. `*io`: NULL, which is replaced by a new list with this ping, to be released with
 * echocast_pings_release; or a list, which then has only this ping and reuses its memory: after the first of their
 * kind, pings allocate up to 20 small blocks, whatever the number of rays and cells.
 *
 * `desc` is as for echocast_scan, which gives the points of the same ping; its `frame` is the number of the ping. A
 * ping has the column `intensity`, the level, and the requested ones among `category_id`, `part_id`, `instance_id`,
 * `material_id`, `time`, `azimuth`, `elevation`, `red`, `green`, `blue`, `normal_x` to `normal_z`, `cos_incidence`,
 * `true_x` to `true_z`, `true_range`, `cause`, `bounces`, `velocity_x` to `velocity_z`, `radial_velocity`, `flow_x` to
 * `flow_z`: they describe the strongest contributor of the cell; where nothing scatters, numbers are NaN and labels 0.
 * What concerns only points in `desc` is not used: organised, coordinates, order, boxes, progress.
 *
 * On an error in the arguments, an existing list is unchanged; if memory runs out, it is empty.
 *
 * Errors: ECHOCAST_E_ARGUMENT (a sensor that is not a sonar, a sonar outside the water, another profile than the
 * physical one), ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY (another thread uses the list, or changes the
 * sensor). Any number of threads may ping one snapshot with one sensor, each into its own list.
 *
 * ```c
 * echocast_pose_key towed = {0, ECHOCAST_POSE_IDENTITY};
 * towed.pose.m[11] = -3;
 * echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
 * desc.sensor = sensor;
 * desc.poses = &towed;
 * desc.pose_count = 1;
 * desc.columns = "intensity,category_id";
 * echocast_pings *pings = NULL;
 * echocast_ping(snapshot, &desc, &pings);
 * ```
 */
ECHOCAST_API
echocast_status echocast_ping(const echocast_snapshot *snapshot,
                              const echocast_scan_desc *desc,
                              echocast_pings **io);

/** The number of pings: 1, or more after echocast_pings_append; 0 for an invalid handle. */
ECHOCAST_API size_t echocast_pings_count(const echocast_pings *pings);

/**
 * Gets information on a ping, counted from 0. The caller sets struct_size of `*info`; what it points to is valid until
 * the list is used for another ping or released.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 *
 * ```c
 * echocast_ping_info info = ECHOCAST_PING_INFO_INIT;
 * echocast_pings_get_info(pings, 0, &info);
 * for (uint32_t beam = 0; beam < info.beams; ++beam)
 *     printf("azimuth %g, elevation %g\n", info.axes[2 * beam], info.axes[2 * beam + 1]);
 * ```
 */
ECHOCAST_API
echocast_status echocast_pings_get_info(const echocast_pings *pings,
                                        size_t ping,
                                        echocast_ping_info *info);

/**
 * Gives access to a column of a ping, counted from 0, without copying it: beams * bins numbers, beam by beam.
 * `column`: "intensity" for the levels, dB re 1 uPa, as ECHOCAST_TYPE_F32, or another requested one. The view is valid
 * until the list is used for another ping or released.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such ping; no such column, or one that was not computed), ECHOCAST_E_HANDLE,
 * ECHOCAST_E_BUSY.
 *
 * ```c
 * echocast_view view;
 * echocast_pings_view(pings, 0, "intensity", &view);
 * const float *level = view.data;
 * ```
 */
ECHOCAST_API
echocast_status echocast_pings_view(const echocast_pings *pings,
                                    size_t ping,
                                    const char *column,
                                    echocast_view *out);

/**
 * Gives access to the soundings of a ping, counted from 0, in place, in the order of beams; none for side-scan and
 * imaging sonars. The view is valid until the list is used for another ping, appended to or released.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 *
 * ```c
 * echocast_sounding_view depths;
 * echocast_pings_soundings(pings, 0, &depths);
 * for (size_t i = 0; i < depths.count; ++i)
 *     printf("%g m\n", ECHOCAST_AT(echocast_sounding, depths, i)->range);
 * ```
 */
ECHOCAST_API
echocast_status echocast_pings_soundings(const echocast_pings *pings,
                                         size_t ping,
                                         echocast_sounding_view *out);

/**
 * Writes the cells of a ping, counted from 0, as an image in the host's layout: a row for each range bin, the nearest
 * first, in it a pixel of `stride` bytes for each beam, and in a pixel each column converted to its type at its
 * offset. Sonar images in ROS have this layout; the columns of a ping are its transpose. Numbers are converted as in
 * echocast_result_pack, and the other arguments are the same; `*needed` is stride * beams * bins.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such ping, a wrong item, too little room), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 *
 * ```c
 * // 8 bits of grey: 0 at the level of the noise, 255 from 60 dB above it on.
 * echocast_ping_info info = ECHOCAST_PING_INFO_INIT;
 * echocast_pings_get_info(pings, 0, &info);
 * const echocast_pack_item grey = {"intensity", ECHOCAST_TYPE_U8, 0, info.noise_db, 255 / 60.0};
 * echocast_pings_pack(pings, 0, &grey, 1, 1, bytes, sizeof bytes, NULL);
 * ```
 */
ECHOCAST_API
echocast_status echocast_pings_pack(const echocast_pings *pings,
                                    size_t ping,
                                    const echocast_pack_item *items,
                                    size_t item_count,
                                    size_t stride,
                                    void *to,
                                    size_t capacity,
                                    size_t *needed);

/**
 * The name of a label number. `table`: "category", "part", "material" or "instance". NULL if it has none.
 *
 * Valid until the list is used for another ping or released.
 */
ECHOCAST_API
const char *echocast_pings_label_name(const echocast_pings *pings,
                                      const char *table,
                                      uint32_t number);

/**
 * Gets the number of a label by its name. `table`: "category", "part", "material" or "instance", of which the first
 * with the name counts.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such name; similar ones are listed), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_pings_label_number(const echocast_pings *pings,
                                            const char *table,
                                            const char *name,
                                            uint32_t *number);

/**
 * Appends copies of other pings of the same sonar and scene with the same columns, to be written to one file, or shown
 * in one image.
 *
 * Errors: ECHOCAST_E_ARGUMENT (pings that do not fit), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY; nothing is then appended.
 */
ECHOCAST_API echocast_status echocast_pings_append(echocast_pings *pings, const echocast_pings *other);

/**
 * Gives access to the pixels of a picture of all pings, in place. `options`: YAML with `view`: "fan" shows the last
 * ping of an imaging or swath sonar, or all pings of a rotating beam, by beam and range; "waterfall" has a row for
 * each ping; "track" is their map, for a swath sonar the map of its depths; also `width` (1600), 320 to 4096 pixels,
 * and `ground` (false), whether a waterfall shows ground range. `layer`: "values", levels with the sonar's time-varied
 * gain, dB re 1 uPa, or on the map of depths heights, metres, NaN where there is no data, as ECHOCAST_TYPE_F32; or a
 * label column of the pings, such as "category_id", 0 where there is no data, as ECHOCAST_TYPE_U32. `place` may be
 * NULL. Each picture is made when it is first requested; the view is valid until the list is used for another ping,
 * appended to or released.
 *
 * Errors: ECHOCAST_E_ARGUMENT (a view that this sonar does not have, no such layer), ECHOCAST_E_PARSE,
 * ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY.
 *
 * ```c
 * echocast_image_view pixels;
 * echocast_image_place place;
 * echocast_pings_image(pings, "{view: fan, width: 800}", "values", &pixels, &place);
 * printf("%u x %u pixels of %g m\n", (unsigned)pixels.width, (unsigned)pixels.height, place.step[0]);
 * ```
 */
ECHOCAST_API
echocast_status echocast_pings_image(const echocast_pings *pings,
                                     const char *options,
                                     const char *layer,
                                     echocast_image_view *out,
                                     echocast_image_place *place);

/** Releases a list of pings. NULL is allowed. Any thread may call this. */
ECHOCAST_API void echocast_pings_release(echocast_pings *pings);

/* -- Frames of radars ------------------------------------------------------------------------------------------------ */

/** The cube: amplitudes of every channel, velocity and range. */
#define ECHOCAST_RADAR_CUBE 1

/** The samples of the converters. The cube is then made from them. */
#define ECHOCAST_RADAR_SAMPLES 2

/** The frame of a radar. Any number of threads may read it; only one at a time may change it. */
typedef struct echocast_radar echocast_radar;

/**
 * What a frame of a radar holds; ECHOCAST_RADAR_INFO_INIT is empty. Arrays are in place, NULL where the frame does not
 * have them.
 */
typedef struct echocast_radar_info {
    /** sizeof(echocast_radar_info). */
    size_t struct_size;
    /** Number of the frame: scan_desc.frame. */
    uint32_t number;
    /** Channels of the cube and of `elements`. */
    uint32_t channels;
    /** Start of the frame, ns. Times since 1970 are rounded to 0.2 microseconds. */
    int64_t t_ns;
    /** Pose of the radar in the world. */
    echocast_pose sensor_pose;
    /** Wavelength in the middle of a chirp, metres. */
    double wavelength_m;
    /** Places of the virtual elements of the channels, metres, x, y, z in the axes of the radar: 3 * channels numbers. */
    const double *elements;
    /**
     * Amplitudes at the receiver, square roots of watts, real and imaginary parts interleaved: 2 * channels *
     * velocities * ranges numbers, range by range. A longer way makes the phase more negative.
     */
    const float *cube;
    /** Velocities of the cube. */
    uint32_t velocities;
    /** Ranges of the cube. */
    uint32_t ranges;
    /** The lowest velocity, m/s; positive velocities recede. */
    double first_velocity;
    /** From one velocity to the next, m/s. */
    double velocity_step;
    /** The lowest range, metres. */
    double first_range_m;
    /** From one range to the next, metres. */
    double range_step_m;
    /**
     * What the converters sampled, chirp by chirp, transmitter by transmitter, receiver by receiver, sample by sample,
     * in phase and in quadrature interleaved.
     */
    const int16_t *samples;
    /** Numbers of chirps of each transmitter, of transmitters, of receivers, and of samples in a chirp. */
    uint32_t sample_shape[4];
    /** Power at the receiver in a turn of a rotating radar, dBm, azimuth by azimuth: azimuths * polar_ranges numbers. */
    const float *polar_dbm;
    /** Direction of each azimuth, rad, counter-clockwise from ahead. */
    const double *polar_azimuth;
    /** When each azimuth was measured, seconds, from the same zero as t_ns. */
    const double *polar_time;
    /** Azimuths of the polar image. */
    uint32_t azimuths;
    /** Ranges of the polar image. */
    uint32_t polar_ranges;
    /** Its lowest range, metres. */
    double polar_first_range_m;
    /** From one of its ranges to the next, metres. */
    double polar_range_step_m;
} echocast_radar_info;

/**
 * Simulates one frame of a radar; of a rotating one, a turn. `*io`: NULL, which is replaced by a new frame, to be
 * released with echocast_radar_release; or a frame, which is replaced by this one. `record`: what is kept, a sum of
 * ECHOCAST_RADAR_ numbers; 0: of rotating radars the polar image, of others nothing. `detections`: NULL, or what
 * echocast_scan takes: receives the detections.
 *
 * `desc` is as for echocast_scan, which gives the detections of the same frame; boxes and progress are not used.
 *
 * On an error, an existing frame is unchanged, and existing detections are unchanged or empty.
 *
 * Errors: ECHOCAST_E_ARGUMENT (a sensor that is not a radar, another profile than the physical one, an unknown number
 * in `record`), ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY (another thread uses the frame or the
 * detections, or changes the sensor). Any number of threads may use one snapshot with one sensor, each with its own
 * frame.
 *
 * ```c
 * echocast_pose_key here = {0, ECHOCAST_POSE_IDENTITY};
 * echocast_scan_desc desc = ECHOCAST_SCAN_DESC_INIT;
 * desc.sensor = sensor;
 * desc.poses = &here;
 * desc.pose_count = 1;
 * echocast_radar *radar = NULL;
 * echocast_radar_frame(snapshot, &desc, ECHOCAST_RADAR_CUBE, &radar, &result);
 * ```
 */
ECHOCAST_API
echocast_status echocast_radar_frame(const echocast_snapshot *snapshot,
                                     const echocast_scan_desc *desc,
                                     uint32_t record,
                                     echocast_radar **io,
                                     echocast_result **detections);

/**
 * Gets what a frame holds. The caller sets struct_size of `*info`; what it points to is valid until the handle is used
 * for another frame or released.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 *
 * ```c
 * echocast_radar_info info = ECHOCAST_RADAR_INFO_INIT;
 * echocast_radar_get_info(radar, &info);
 * size_t cell = ((size_t)0 * info.velocities + info.velocities / 2) * info.ranges; // channel 0, near 0 m/s
 * for (uint32_t range = 0; range < info.ranges; ++range)
 *     printf("%g m: %g + %gj\n", info.first_range_m + range * info.range_step_m, info.cube[2 * (cell + range)],
 *            info.cube[2 * (cell + range) + 1]);
 * ```
 */
ECHOCAST_API
echocast_status echocast_radar_get_info(const echocast_radar *radar,
                                        echocast_radar_info *info);

/**
 * Writes a frame to a file, by the ending of `path`: NPZ (`.npz`) or HDF5 (`.h5`, `.hdf5`), arrays with their axes; or
 * the samples alone in the layout of TI's capture card DCA1000 (`.bin`). The file appears under its name only when it
 * is complete and on the disk.
 *
 * Errors: ECHOCAST_E_ARGUMENT (`.bin` without samples), ECHOCAST_E_IO (a full disk), ECHOCAST_E_UNSUPPORTED (another
 * ending; HDF5 that is not built in), ECHOCAST_E_MEMORY, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 *
 * ```c
 * echocast_radar_write(radar, "frame.npz");
 * ```
 */
ECHOCAST_API echocast_status echocast_radar_write(const echocast_radar *radar, const char *path);

/**
 * Writes a picture of a frame as PNG (`.png`), with scale and legend. `options`: YAML with `view`: "range_doppler" or
 * "range_azimuth" of the cube, "polar" of the polar image; and `width` (1600), 320 to 4096 pixels.
 *
 * Errors: ECHOCAST_E_ARGUMENT (another view, a frame without what it shows, a width out of bounds), ECHOCAST_E_PARSE,
 * ECHOCAST_E_UNSUPPORTED (another ending), ECHOCAST_E_IO, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 *
 * ```c
 * echocast_radar_preview(radar, "doppler.png", "{view: range_doppler}");
 * ```
 */
ECHOCAST_API
echocast_status echocast_radar_preview(const echocast_radar *radar,
                                       const char *path,
                                       const char *options);

/** Releases a frame. NULL is allowed. Any thread may call this. */
ECHOCAST_API void echocast_radar_release(echocast_radar *radar);

/* -- Scenarios ------------------------------------------------------------------------------------------------------- */

/**
 * A sample of a scenario: its scene with the values drawn for it, and the scans of its sensors. Any number of threads
 * may read it; only one at a time may scan it.
 */
typedef struct echocast_sample echocast_sample;

/**
 * A file that makes samples: a scene, a rig of sensors, and what varies from sample to sample. Any number of threads
 * may make samples of it; only one at a time may change it.
 */
typedef struct echocast_scenario echocast_scenario;

/** The scan of one sensor of the rig in a sample; ECHOCAST_SCAN_INFO_INIT is empty. */
typedef struct echocast_scan_info {
    /** sizeof(echocast_scan_info). */
    size_t struct_size;
    /** Number of its frames; for a sonar, of its pings. */
    size_t frames;
    /**
     * Buffer for the name of the sensor in the rig, which ends in 0 and is cut off if it is too long; NULL if not
     * needed. Set by the caller.
     */
    char *name;
    /** Capacity of `name`, bytes. Set by the caller. */
    size_t name_capacity;
} echocast_scan_info;

/** The time of a frame; ECHOCAST_FRAME_INFO_INIT is empty. */
typedef struct echocast_frame_info {
    /** sizeof(echocast_frame_info). */
    size_t struct_size;
    /** Its start, ns since the start of the run, from which the column `time` counts. */
    int64_t start_ns;
    /** Longest duration of the scan, ns. */
    int64_t duration_ns;
    /** Number of the frame, as in the column `frame`. */
    uint32_t number;
    /** 0. */
    uint32_t reserved;
} echocast_frame_info;

/**
 * Reads a scenario file, or the report of `echocast scan --json`. File names in it are relative to its folder, or to
 * its key `folder`. Scenes and models are read with the first sample that needs them, and kept for the others. Its
 * `outputs` are for the program and not used here.
 *
 * Errors: ECHOCAST_E_IO, ECHOCAST_E_PARSE (file, line, key), ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE. Any thread may
 * call this.
 *
 * ```c
 * echocast_scenario *drive;
 * echocast_scenario_load(context, "drive.yaml", &drive);
 * ```
 */
ECHOCAST_API
echocast_status echocast_scenario_load(const echocast_context *context,
                                       const char *path,
                                       echocast_scenario **out);

/**
 * Like echocast_scenario_load, from YAML text with the contents of a scenario file. `folder`: the folder that paths in
 * it are relative to; NULL for the working folder.
 *
 * Errors: ECHOCAST_E_IO, ECHOCAST_E_PARSE (line and key), ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE. Any thread may call
 * this.
 */
ECHOCAST_API
echocast_status echocast_scenario_from_text(const echocast_context *context,
                                            const char *yaml,
                                            const char *folder,
                                            echocast_scenario **out);

/**
 * Changes a key of a scenario: `key` is its path (`frames.last`, `sensors.top.rate_hz`, `sensors[0].mount`), `value`
 * YAML. Existing samples stay as they are; the next one reads its scene and models again.
 *
 * Errors: ECHOCAST_E_PARSE (key, what was found, what is allowed), ECHOCAST_E_IO, ECHOCAST_E_ARGUMENT,
 * ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY (another thread makes a sample); the scenario is then unchanged.
 */
ECHOCAST_API
echocast_status echocast_scenario_set(echocast_scenario *scenario,
                                      const char *key,
                                      const char *value);

/**
 * Writes the number of samples of a scenario to `*out`.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API echocast_status echocast_scenario_samples(const echocast_scenario *scenario, uint64_t *out);

/**
 * Makes a sample, counted from 0: draws what varies and sets up its scene and scans. It is the same whether it is made
 * alone, in any order or on any thread, and the one that `echocast run` writes; the number may exceed the samples of
 * the scenario, up to 4294967295. `*out` is the new sample; release it with echocast_sample_release. Warnings are
 * reported to the context's log: objects for which there was no room, what scene files lack.
 *
 * Any number of threads may make samples of one scenario: with a context of one thread in parallel; a context of
 * several threads uses all of them for one sample after the other.
 *
 * Errors: ECHOCAST_E_IO, ECHOCAST_E_PARSE (file and place), ECHOCAST_E_UNSUPPORTED, ECHOCAST_E_ARGUMENT (a drawn value
 * that is not allowed, no room for what must be placed), ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY
 * (another thread changes the scenario).
 */
ECHOCAST_API
echocast_status echocast_scenario_sample(const echocast_scenario *scenario,
                                         uint64_t sample,
                                         echocast_sample **out);

/** Releases a scenario; its samples stay. NULL is allowed. Any thread may call this. */
ECHOCAST_API void echocast_scenario_release(echocast_scenario *scenario);

/**
 * Writes the number of scans of a sample, one for each sensor of the rig, to `*out`.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API echocast_status echocast_sample_scans(const echocast_sample *sample, size_t *out);

/**
 * Gets information on a scan, counted from 0 in the order of the rig. The caller sets struct_size of `*info`, and the
 * buffer for the name.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_sample_get_scan(const echocast_sample *sample,
                                         size_t scan,
                                         echocast_scan_info *info);

/**
 * Gets the time of a frame of a scan, counted from 0. The caller sets struct_size of `*info`.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_sample_get_frame(const echocast_sample *sample,
                                          size_t scan,
                                          size_t frame,
                                          echocast_frame_info *info);

/**
 * Gets a copy of the sensor of a scan, with the values drawn for it: `*out` is a sensor like any other, to be released
 * with echocast_sensor_release.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_sample_sensor(const echocast_sample *sample,
                                       size_t scan,
                                       echocast_sensor **out);

/**
 * Writes what was drawn for a sample, in the order of the rules, as JSON to `json`, which has room for `capacity`
 * bytes; longer text is cut off. It is the list `drawn` of the files samples/NUMBER.json that `echocast run` writes.
 * `*needed`: bytes of the whole text, including the 0 at its end. One of `json` and `needed` may be NULL.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_sample_drawn(const echocast_sample *sample,
                                      char *json,
                                      size_t capacity,
                                      size_t *needed);

/**
 * Sets which boxes the following scans of a sample have: `boxes` and `image_boxes` as in echocast_scan_desc; none by
 * default. The time for which they are valid is set by the scenario (`boxes`).
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 *
 * ```c
 * echocast_sample_set_boxes(sample, ECHOCAST_BOXES_OBJECT, 0);
 * echocast_sample_scan(sample, 0, 0, NULL, &result);
 * echocast_box_view boxes;
 * echocast_result_boxes(result, &boxes);
 * ```
 */
ECHOCAST_API
echocast_status echocast_sample_set_boxes(echocast_sample *sample,
                                          int32_t boxes,
                                          int32_t image_boxes);

/**
 * Scans a frame of a sample as the scenario specifies: scan and frame are counted from 0; a sonar sends the ping with
 * that number. `columns`: NULL for those of the scenario (`fields`); else names as in echocast_scan_desc, where
 * "default" stands for these. `*io`: NULL, which is replaced by a new result, or a result, whose memory is reused, as
 * for echocast_scan. Frames may be scanned in any order and repeatedly: the points are the same.
 *
 * One thread at a time may scan a sample; several threads may each scan their own.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY. On an error in the arguments, an
 * existing result is unchanged; if memory runs out, it is empty.
 *
 * ```c
 * uint64_t samples;
 * echocast_scenario_samples(scenario, &samples);
 * for (uint64_t i = 0; i < samples; ++i) {
 *     echocast_sample *sample;
 *     echocast_scenario_sample(scenario, i, &sample);
 *     echocast_sample_scan(sample, 0, 0, NULL, &result);
 *     echocast_sample_release(sample);
 * }
 * ```
 */
ECHOCAST_API
echocast_status echocast_sample_scan(echocast_sample *sample,
                                     size_t scan,
                                     size_t frame,
                                     const char *columns,
                                     echocast_result **io);

/**
 * Sends a ping of a sonar of a sample as the scenario specifies: like echocast_sample_scan, but into a list of pings,
 * as echocast_ping does.
 *
 * Errors: ECHOCAST_E_ARGUMENT (a scan whose sensor is not a sonar), ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY,
 * ECHOCAST_E_BUSY. On an error in the arguments, an existing list is unchanged; if memory runs out, it is empty.
 *
 * ```c
 * echocast_pings *pings = NULL;
 * echocast_sample_ping(sample, 0, 0, NULL, &pings);
 * ```
 */
ECHOCAST_API
echocast_status echocast_sample_ping(echocast_sample *sample,
                                     size_t scan,
                                     size_t frame,
                                     const char *columns,
                                     echocast_pings **io);

/** Releases a sample. NULL is allowed. Any thread may call this. */
ECHOCAST_API void echocast_sample_release(echocast_sample *sample);

/* -- Files ----------------------------------------------------------------------------------------------------------- */

/** An HDF5 file that grows by one scan at a time. */
typedef struct echocast_frames echocast_frames;

/**
 * Writes the points to a file, which appears under its name only when it is complete and on the disk. `format`: a name
 * from the list "formats"; NULL: chosen by the ending of `path`. Label names are in the file, or in NAME.labels.json
 * beside it, which appears just before; an error leaves both as they were. What a format cannot hold is reported to
 * the context's log.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_IO (a full disk), ECHOCAST_E_UNSUPPORTED, ECHOCAST_E_HANDLE,
 * ECHOCAST_E_BUSY.
 */
ECHOCAST_API echocast_status echocast_result_write(const echocast_result *result, const char *path, const char *format);

/**
 * Writes a picture of the points as PNG (`.png`). `options`: NULL, or YAML with `view` (top, perspective, range),
 * `color` (label, cause, intensity, range, height, velocity, radial_velocity, doppler, density) and `width` in pixels.
 * The result needs the columns that the colours show; without them other colours are used, with a warning in the log.
 * With the column `cause`, points of rain, fog and the like have their own colours.
 *
 * Errors: ECHOCAST_E_ARGUMENT (a view that is not available for points, a width out of bounds), ECHOCAST_E_PARSE,
 * ECHOCAST_E_UNSUPPORTED (another ending), ECHOCAST_E_IO, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_result_preview(const echocast_result *result,
                                        const char *path,
                                        const char *options);

/**
 * Writes the pings to a file, as NPZ (`.npz`) or HDF5 (`.h5`, `.hdf5`) by the ending of `path`: arrays of pings x
 * beams x bins, soundings, and what all pings have in common. The file appears under its name only when it is complete
 * and on the disk. What the format cannot hold is reported to the context's log.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_IO (a full disk), ECHOCAST_E_UNSUPPORTED (another ending; HDF5 that is not
 * built in), ECHOCAST_E_MEMORY, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 *
 * ```c
 * echocast_pings_write(pings, "survey.npz");
 * ```
 */
ECHOCAST_API echocast_status echocast_pings_write(const echocast_pings *pings, const char *path);

/**
 * Writes a picture of the pings as PNG (`.png`), with scales and a legend. `options`: YAML with `view`, `width` and
 * `ground` as for echocast_pings_image, and `color` (label, intensity); pings without labels are coloured by
 * intensity, with a warning in the log.
 *
 * Errors: ECHOCAST_E_ARGUMENT (a view that this sonar does not have, a width out of bounds), ECHOCAST_E_PARSE,
 * ECHOCAST_E_UNSUPPORTED (another ending), ECHOCAST_E_IO, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 *
 * ```c
 * echocast_pings_preview(pings, "fan.png", "{view: fan, color: intensity}");
 * ```
 */
ECHOCAST_API echocast_status echocast_pings_preview(const echocast_pings *pings, const char *path, const char *options);

/**
 * Starts an HDF5 file that takes scans one by one, each as one row of every dataset; only one is in memory at a time.
 * The file appears under its name with echocast_frames_finish; if released before, it leaves nothing behind.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_IO, ECHOCAST_E_UNSUPPORTED (built without HDF5), ECHOCAST_E_HANDLE.
 */
ECHOCAST_API
echocast_status echocast_frames_create(const echocast_context *context,
                                       const char *path,
                                       echocast_frames **out);

/**
 * Appends the points of a scan as the next row.
 *
 * Errors: ECHOCAST_E_ARGUMENT (a scan that does not fit the first), ECHOCAST_E_IO, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API echocast_status echocast_frames_add(echocast_frames *frames, const echocast_result *result);

/**
 * Completes the file and gives it its name; late disk errors appear here.
 *
 * Errors: ECHOCAST_E_IO, ECHOCAST_E_ARGUMENT (it is already finished), ECHOCAST_E_HANDLE,
 * ECHOCAST_E_BUSY.
 */
ECHOCAST_API echocast_status echocast_frames_finish(echocast_frames *frames);

/** Releases a frames file. NULL is allowed. Any thread may call this. */
ECHOCAST_API void echocast_frames_release(echocast_frames *frames);

#ifdef __cplusplus
}
#endif

#endif /* ECHOCAST_H */
