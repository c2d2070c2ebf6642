/* echocast: simulated depth sensors. C99, no other header needed.
 *
 * Generated from crates/echocast-capi by its test `header`; do not edit.
 *
 * Units are metres, radians and nanoseconds; a name with another unit says so. Frames are right-handed, z up; sensors
 * look along x, y is left. Strings are UTF-8 and end in 0; paths are bytes where the system's are.
 *
 * Functions return ECHOCAST_OK or why they failed; echocast_last_error says it in a sentence. A function that creates
 * something sets *out to NULL first. Nothing here ends the process, prints, or sets a signal handler; the
 * floating-point state of the caller is restored after every call. Where files may grow to a limit, SIGXFSZ is the
 * host's to ignore or handle: then the limit is an error, like a full disk.
 *
 * What cannot be checked is undefined behaviour, as always in C: pointers that are neither NULL nor point to what the
 * function asks for, arrays shorter than their count, strings without an end, a struct_size larger than the structure,
 * memory that is freed or changed during a call. Handles are looked up and never dereferenced.
 *
 * Threads: functions that take a pointer to const only read, and any number of threads may call them at once for one
 * object. Of the other functions, one thread at a time may be in a call for one object; another gets ECHOCAST_E_BUSY.
 * Handles may be released on any thread, once; whatever uses the object keeps it.
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

/** The pose of something at the parent's origin, not rotated. */
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
    { sizeof(echocast_scan_desc), 0, 0, 0, 0, 0, 0, 0xffffffffu, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0 }
#define ECHOCAST_RESULT_INFO_INIT                                                                                      \
    { sizeof(echocast_result_info), 0, 0, 0, 0, 0, { 0, 0, 0 }, ECHOCAST_POSE_IDENTITY }
#define ECHOCAST_DRIVER_INFO_INIT { sizeof(echocast_driver_info), 0, 0, 0, { { 0, 0, 0 } } }
#define ECHOCAST_PING_INFO_INIT                                                                                        \
    { sizeof(echocast_ping_info), 0, 0, 0, ECHOCAST_POSE_IDENTITY, { 0, 0, 0 }, 0, 0, 0, 0, 0, 0, 0, 0, 0 }
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

/** The system gives no more memory, or no more threads. */
#define ECHOCAST_E_MEMORY 4

/** The system refused a file: it is missing, not permitted, the disk is full. */
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

/** Version of the running library: major << 24 | minor << 12 | patch. That of the header is ECHOCAST_VERSION. */
ECHOCAST_API uint32_t echocast_version(void);

/**
 * The version and what is built in, for people: "echocast 0.1.0 (fbx, hdf5, mcap)".
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

/** How a context works; ECHOCAST_CONTEXT_DESC_INIT has the defaults. */
typedef struct echocast_context_desc {
    /** sizeof(echocast_context_desc). */
    size_t struct_size;
    /**
     * Threads that scan, up to 1024: the calling one, which needs 256 KiB of stack, and others of the context's own, who
     * help all callers at once, those with the fewest rays first. 0 for as many as the machine has cores, 1 for the
     * calling thread alone. One less, up to one per core, help to build large meshes. All are started with the context;
     * nothing asks the system for threads later, nor does Embree's TBB.
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
 * Creates a context: starts its threads, which have the signal mask of this one, and loads Embree. A process forked
 * afterwards does not have these threads: create contexts after a fork. `desc`: NULL for the defaults. `*out` is the
 * new context; release it with echocast_context_release.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_UNSUPPORTED (Embree is too old, or the processor), ECHOCAST_E_MEMORY (the
 * system gives no memory, or not enough threads). Any thread may call this.
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

/** The call copies the arrays of a mesh. */
#define ECHOCAST_MESH_COPY 0

/** The arrays of a mesh stay the host's, which neither changes nor frees them before `released` is called. */
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
    /** Three vertices for each triangle. */
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
 * Creates a mesh. Its own structure for tracing is built when an instance is first committed, or by
 * echocast_mesh_prepare.
 *
 * Errors: ECHOCAST_E_ARGUMENT (the vertex, index or part that is wrong), ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY. Any
 * thread may call this, also while scenes are edited.
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
 * Builds the structure that instances of the mesh are traced with, which the first commit would otherwise build.
 *
 * Errors: ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY. Any thread may call this, also while scenes are edited.
 */
ECHOCAST_API echocast_status echocast_mesh_prepare(const echocast_mesh *mesh);

/** Releases a mesh; instances keep it. NULL is allowed. Any thread may call this. */
ECHOCAST_API void echocast_mesh_release(echocast_mesh *mesh);

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

/**
 * A placement: the upper three rows of the 4x4 matrix, row after row, that takes points of the child (an instance, a
 * sensor) to the parent (the world); the fourth column is the position in metres. Instances may be scaled, sheared and
 * mirrored; sensors are only turned and moved.
 */
typedef struct echocast_pose {
    /** Row after row. */
    double m[12];
} echocast_pose;

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
     * 1: it stays where it is. Fixed instances with a mesh of their own are built together, the fastest to trace;
     * whenever one is added, removed or changed, all are rebuilt. 0: it may move, at a cost of a few microseconds per
     * commit.
     */
    int32_t fixed;
    /** Replaces the materials of the mesh; NULL to keep those. */
    const echocast_material *material;
    /** Name, for echocast_scene_find, messages and the files' table of instances; NULL for none. */
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
    /** Where its name is written, ending in 0, cut off if it is too long; NULL if not wanted. Set by the caller. */
    char *name;
    /** Capacity of `name`, bytes. Set by the caller. */
    size_t name_capacity;
} echocast_instance_info;

/** The contents of a scene; ECHOCAST_SCENE_INFO_INIT is empty. */
typedef struct echocast_scene_info {
    /** sizeof(echocast_scene_info). */
    size_t struct_size;
    /** Instances. */
    size_t instances;
    /** Triangles, each mesh counted as often as it is placed. */
    size_t triangles;
    /** Lowest corner of the box around all instances, in the world, metres; all 0 without instances. */
    double low[3];
    /** Highest corner of that box. */
    double high[3];
    /** Camera nodes of the loaded files. */
    size_t cameras;
} echocast_scene_info;

/** A pose at a time. */
typedef struct echocast_pose_key {
    /** Time, ns. */
    int64_t t_ns;
    /** Where the sensor or instance is at that time, in the world. */
    echocast_pose pose;
} echocast_pose_key;

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
 * them; `labels`, a label file, its contents or the name of rules that ship (`street`); `texture_limit_mib` (1024),
 * most memory for all images; `animation`, the name of the one to play instead of all; `loop` (false), whether
 * animations start again at their ends; and `allow_outside_paths` (false), whether the scene may name files that are
 * not in its own folder. Categories and parts whose name is already in the scene get its number there; instances are
 * numbered on from the greatest number that has a name, from 1 if there is none.
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
 * Finds the first instance with a name; instances from files have their names in the file.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such name; similar ones are listed), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_scene_find(const echocast_scene *scene,
                                    const char *name,
                                    echocast_instance *out);

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
 * Gets the state of an instance. The caller sets struct_size of `*info`, and where its name is to go.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_scene_get_instance(const echocast_scene *scene,
                                            echocast_instance id,
                                            echocast_instance_info *info);

/**
 * Gets the pose of the camera node with a name in a loaded file, as a sensor's pose: x along its view, z up.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such name; similar ones are listed), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_scene_camera(const echocast_scene *scene,
                                      const char *name,
                                      echocast_pose *out);

/**
 * Gets the name and, as a sensor's pose, the place at time 0 of camera node `number` of the loaded files, counted from 0;
 * echocast_scene_get_info says how many there are. `name` has room for `capacity` bytes, a longer name is cut off;
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
 * Gets the number that has a name in a label column. `table`: "category", "part", "material" or "instance", where the
 * first instance of the name counts.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such name; similar ones are listed), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_scene_label_number(const echocast_scene *scene,
                                            const char *table,
                                            const char *name,
                                            uint32_t *number);

/**
 * Makes a pose of a position, metres, and a unit quaternion x, y, z, w: the real part last, the order of ROS. It is
 * normalised.
 *
 * Errors: ECHOCAST_E_ARGUMENT (numbers that are not finite, a quaternion whose length is not near 1). Any thread may
 * call this.
 */
ECHOCAST_API
echocast_status echocast_pose_from_quaternion(const double *position,
                                              const double *xyzw,
                                              echocast_pose *pose);

/**
 * Gets the contents of a scene. The caller sets struct_size of `*info`.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_scene_get_info(const echocast_scene *scene,
                                        echocast_scene_info *info);

/**
 * Moves instances: `ids[i]` to `poses[i]`, all or, on an error, none. Fixed instances may move from then on.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_scene_set_poses(echocast_scene *scene,
                                         size_t count,
                                         const echocast_instance *ids,
                                         const echocast_pose *poses);

/**
 * Moves an instance during the scans that follow: through `count` poses at times that never fall, in straight lines and
 * turning uniformly between them; before the first and after the last it stands. Times count from the same zero as
 * echocast_scan_desc.t0_ns. The poses may scale along the instance's own axes, but not shear. The keys are copied;
 * echocast_scene_set_time says which of the motion the next snapshot shows, and echocast_scene_set_poses ends it.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY; the instance then moves as before.
 */
ECHOCAST_API
echocast_status echocast_scene_set_motion(echocast_scene *scene,
                                          echocast_instance id,
                                          const echocast_pose_key *keys,
                                          size_t count);

/**
 * Sets the time of the scans of the next snapshots: what moves by itself, through the animations of files,
 * echocast_scene_set_motion or echocast_scene_set_vertex_motion, is where it is at every moment from `start_ns` to
 * `start_ns + length_ns`. A scan of such a snapshot must lie within that time. With a length of 0 everything holds
 * still where it is at `start_ns`, whatever the time of a scan; a new scene is set to time 0, still.
 *
 * Errors: ECHOCAST_E_ARGUMENT (a negative length), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API echocast_status echocast_scene_set_time(echocast_scene *scene, int64_t start_ns, int64_t length_ns);

/**
 * Gives the vertices of an instance new positions: `count` times x, y, z, as many as its mesh has, and shading
 * normals, or NULL for flat triangles. It then has its own mesh; others that share the mesh keep it. The arrays are
 * copied. The parts of its mesh must share their vertices, as those of echocast_mesh_create do; those of files may
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
 * Lets the vertices of an instance move during the scans that follow: `keys` times, ns as those of
 * echocast_scene_set_motion, that rise, and for each of them one after the other `count` times x, y, z, as many as its
 * mesh has, in its own frame. Between keys they move in straight lines; before the first and after the last they stand.
 * Its triangles stay, and are flat. The arrays are copied. The parts of its mesh must share their vertices, as for
 * echocast_scene_set_vertices, which ends it.
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
 * Sets the labels of an instance: its category, its own number, and those of the parts of its mesh, or NULL to keep
 * these.
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

/**
 * Names a number in a label column; the names travel with every file. `table`: "category", "part" or "instance".
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

/* -- Sensors --------------------------------------------------------------------------------------------------------- */

/** Every beam is its own firing. */
#define ECHOCAST_FIRING_BEAMS 0

/** All beams of a column belong to one firing. */
#define ECHOCAST_FIRING_COLUMNS 1

/** All beams belong to one firing. */
#define ECHOCAST_FIRING_FRAME 2

/**
 * An instrument: where its beams point, what it sees, and the errors it makes. Any number of threads may scan with it;
 * only one at a time may change it.
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
    /** Where it starts in the sensor frame, metres, from where its ranges count; 0 for the origin of the frame. */
    float origin[3];
    /** 0. */
    uint32_t reserved;
} echocast_beam;

/** A sensor made of beams; ECHOCAST_BEAMS_DESC_INIT is empty. */
typedef struct echocast_beams_desc {
    /** sizeof(echocast_beams_desc). */
    size_t struct_size;
    /** Its name. */
    const char *name;
    /**
     * rows * columns beams, row by row. Neighbours in a row should be neighbours in angle: this is several times as
     * fast.
     */
    const echocast_beam *beams;
    /** Rows of its range image. */
    uint32_t rows;
    /** Columns of its range image. */
    uint32_t columns;
    /** Time from the start of one scan to the start of the next, ns, above 0. */
    int64_t period_ns;
    /** How beams share firings: an ECHOCAST_FIRING_ number. */
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
    /** Columns of its range image. It has rows * columns beams; beam row * columns + column. */
    uint32_t columns;
    /** Time from the start of one scan to the start of the next, ns. */
    int64_t period_ns;
    /** Width of the images that echocast_result_image makes of its scans, pixels; 0 if it makes none. */
    uint32_t image_width;
    /** Their height, pixels. */
    uint32_t image_height;
    /** Focal lengths of a camera along columns and rows, pixels; 0 for other sensors. */
    double focal[2];
    /** Principal point of a camera, column and row, where whole numbers are the middle of pixels, as OpenCV counts. */
    double centre[2];
    /** Whose ROS 2 driver it has: an ECHOCAST_DRIVER_ number; 0 if that is not known. It numbers the rings. */
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
 * Creates a sensor from YAML text with the contents of a sensor file. `folder`: where relative paths in it start; NULL
 * for the working folder.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_IO, ECHOCAST_E_PARSE (line and key). Any thread may call this.
 */
ECHOCAST_API
echocast_status echocast_sensor_from_text(const echocast_context *context,
                                          const char *yaml,
                                          const char *folder,
                                          echocast_sensor **out);

/**
 * Creates an ideal lidar from beams, each a ray with its own origin and time: no noise, no threshold, no range limit
 * but theirs; echocast_sensor_set adds what you want. Rays without rows and columns are 1 row of many columns.
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
 * Reads a parameter that is a number, with the least and the greatest value that is allowed (infinite if unbounded).
 * `value`, `min` and `max` may each be NULL.
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

/* -- Results --------------------------------------------------------------------------------------------------------- */

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

/** Points, column by column. Any number of threads may read it; only one at a time may change it. */
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
    /** Where the sensor was at the start of the scan. */
    echocast_pose sensor_pose;
} echocast_result_info;

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
 * Gives access to a column without copying it. The view is valid until the result is scanned into, appended to or
 * released.
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
 * not-a-number becomes 0 in integers. Positions are relative to the result's origin as ECHOCAST_TYPE_F32, and complete
 * as ECHOCAST_TYPE_F64. Up to 64 items. `capacity`: bytes of `to`; `*needed` (may be NULL): stride * points; if `to`
 * is NULL, only that is written.
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
 * Valid until the result is scanned into or released.
 */
ECHOCAST_API
const char *echocast_result_label_name(const echocast_result *result,
                                       const char *table,
                                       uint32_t number);

/**
 * Gets the number that has a name in a label column. `table`: "category", "part", "material" or "instance", where the
 * first instance of the name counts.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such name; similar ones are listed), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_result_label_number(const echocast_result *result,
                                             const char *table,
                                             const char *name,
                                             uint32_t *number);

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

/** A number that each point of a driver's messages has, as sensor_msgs/PointField says it. */
typedef struct echocast_point_field {
    /** Its name. */
    const char *name;
    /** Type: an ECHOCAST_TYPE_ number. */
    int32_t kind;
    /** Its first byte in the point. */
    uint32_t offset;
} echocast_point_field;

/** What a driver publishes; ECHOCAST_DRIVER_INFO_INIT is empty. */
typedef struct echocast_driver_info {
    /** sizeof(echocast_driver_info). */
    size_t struct_size;
    /** The columns that a scan must have, for scan_desc.columns: "x,y,z,intensity,ring,time". */
    const char *columns;
    /** Bytes of a point. */
    size_t point_step;
    /** Number of its fields. */
    size_t field_count;
    /** Its fields. */
    echocast_point_field fields[16];
} echocast_driver_info;

/**
 * Gets what a driver publishes of a point: names, types and offsets of the fields, for the message, and the columns that
 * a scan must have. The caller sets struct_size of `*info`. Texts are static.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such driver).
 */
ECHOCAST_API
echocast_status echocast_driver_get_info(int32_t driver,
                                         echocast_driver_info *info);

/**
 * Gets height and width of the message that a driver makes of a result: of organised results those of the driver's image,
 * which for Velodyne and RoboSense has the rings side by side and the firings below each other; else 1 and the number of
 * points.
 *
 * Errors: ECHOCAST_E_ARGUMENT (no such driver), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_result_driver_shape(const echocast_result *result,
                                             int32_t driver,
                                             uint32_t *height,
                                             uint32_t *width);

/**
 * Writes the points as a driver publishes them, point i at `to + i * point_step`. Positions are in the frame of the
 * sensor where the scan starts; those of a scan with ECHOCAST_COORDINATES_SENSOR and without scan_desc.deskew stay in the
 * frame of their own firing. Times count from `stamp_ns` on, the stamp of the message, where the driver's do (Velodyne,
 * Ouster, Autoware), else from the start of the run; the ring is that of the column `ring`. Points of organised results
 * come in the order of the driver's image (echocast_result_driver_shape). All bytes are written, those of no field as 0.
 * Where no azimuth, elevation and range were computed, they are those of the positions. `capacity`: bytes of `to`;
 * `*needed` (may be NULL): point_step * points; if `to` is NULL, only that is written.
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

/* -- Scans ----------------------------------------------------------------------------------------------------------- */

/** Points are in the world frame. */
#define ECHOCAST_COORDINATES_WORLD 0

/** Points are in the sensor frame at the time of their own firing, as a driver reports them. */
#define ECHOCAST_COORDINATES_SENSOR 1

/** Points are in order of rising beam. */
#define ECHOCAST_ORDER_BEAM 0

/** Points are in order of rising time. */
#define ECHOCAST_ORDER_TIME 1

/** Physics as we know it. */
#define ECHOCAST_PROFILE_PHYSICAL 0

/** The equations of the paper as printed. */
#define ECHOCAST_PROFILE_PAPER 1

/** What the paper's program computes. */
#define ECHOCAST_PROFILE_BLAINDER 2

/** As the profile defines. */
#define ECHOCAST_REFLECTANCE_DEFAULT 0

/** Surfaces without a given reflectance take the luminance of their linear base colour, whatever the wavelength. */
#define ECHOCAST_REFLECTANCE_LUMINANCE 1

/** Surfaces without a given reflectance take the alpha of their base colour. */
#define ECHOCAST_REFLECTANCE_ALPHA 2

/**
 * Surfaces without a given reflectance take that of the library material that their name speaks of; else what their
 * base colour suggests for the wavelength. The physical profile's default.
 */
#define ECHOCAST_REFLECTANCE_LIBRARY 3

/** No boxes. */
#define ECHOCAST_BOXES_NONE 0

/** Boxes along the axes of each object, z up as it was modelled. */
#define ECHOCAST_BOXES_OBJECT 1

/** Boxes along the axes of the frame of the points. */
#define ECHOCAST_BOXES_FRAME 2

/**
 * Boxes hold when their objects are scanned: each at the mean time of its points; without any, in the middle of the
 * scan. With scan_desc.deskew, whose points are of the start: at the start.
 */
#define ECHOCAST_BOX_TIME_SCAN 0

/** Boxes hold when the scan starts. */
#define ECHOCAST_BOX_TIME_START 1

/** Boxes hold when the last beam of the scan fires. */
#define ECHOCAST_BOX_TIME_END 2

/**
 * Progress callback: gets the fraction of the work that is done, 0 to 1; returning anything but 0 ends the scan,
 * unless it is complete. Called on the scanning thread, every 2048 beams of each thread; not for sonars. It must not
 * throw, and the result is in use during the call.
 */
typedef int32_t (*echocast_progress_fn)(void *user, double fraction);

/** How to scan; ECHOCAST_SCAN_DESC_INIT has the defaults. */
typedef struct echocast_scan_desc {
    /** sizeof(echocast_scan_desc). */
    size_t struct_size;
    /** The sensor to scan with. */
    const echocast_sensor *sensor;
    /**
     * Where the sensor is: one pose, or several at rising times, between which it moves evenly and turns the shorter
     * way; before the first and after the last it stands still. Each beam is cast from the pose at the time of its own
     * firing.
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
     * ("default" in a list): `doppler` is one of a sensor that measures it.
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
    /** Gets the progress of the scan and may end it; may be NULL. */
    echocast_progress_fn progress;
    /** First argument of `progress`. */
    void *progress_user;
    /**
     * What is in the air, and the water a sonar is in, as YAML with the keys of a scenario's section `environment`
     * ("{rain: {rate_mm_h: 10}}", "{water: {temperature_c: 8}}"), or NULL: clear air, and for sonars the sea below z =
     * 0. A text that is the same as in the result's last scan is not parsed again.
     */
    const char *environment;
    /** 1: what moves holds still during the scan, where it is at t0_ns. 0: every beam meets it at its own time. */
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
     * 1: the boxes also say where they are in the image of the sensor, whatever hides them, for which every triangle
     * is looked at: the amodal boxes of echocast_result_image_boxes.
     */
    int32_t image_boxes;
    /**
     * When boxes hold: an ECHOCAST_BOX_TIME_ number. Of programs that were compiled when this was not there yet, boxes
     * hold at the start, as they were told.
     */
    int32_t box_time;
    /**
     * 1: positions and normals are brought to t0_ns: what moves is where it was then, with all points that lie on it,
     * and ECHOCAST_COORDINATES_SENSOR is the sensor frame then. The other columns, also `true_x`, `true_y` and `true_z`,
     * say what was when the beam fired. Not for sonars.
     */
    int32_t deskew;
} echocast_scan_desc;

/**
 * Scans once; a sonar sends one ping, whose echoes are the points. `*io`: NULL, and it becomes a new result, to be
 * released with echocast_result_release; or a result, whose memory is reused: after the first few of their kind, scans
 * in beam order of lidars and depth cameras allocate nothing, whatever the sensor, in any weather and in front of
 * mirrors and glass; with another profile than the physical one, or boxes, they take some small blocks, a ping of a sonar
 * up to 20.
 *
 * Points of a sonar: for multibeam and single-beam sonars the depth of each beam; for side-scan and imaging sonars the
 * range bins with an echo. Their `intensity` is a level in dB re 1 uPa. Sonars must be in the water. echocast_ping gives
 * whole pings.
 *
 * On an error in the arguments, an old result stays as it was; after a cancelled scan, or one for which there was no
 * memory, it is empty.
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

/* -- Boxes ----------------------------------------------------------------------------------------------------------- */

/**
 * The box around a labelled instance. Position, orientation and velocity are in the frame of the points; in sensor
 * coordinates that is the sensor's frame when the box holds, or when the scan starts if its points are brought there.
 */
typedef struct echocast_box {
    /** When the box holds (scan_desc.box_time), ns. Times since 1970 are rounded to 0.2 microseconds. */
    int64_t t_ns;
    /** Number of the frame, as in the column `frame`. */
    uint32_t frame;
    /** The object over all frames, as in the column `track_id`. */
    uint32_t track_id;
    /** The object, as in the column `instance_id`; never 0. */
    uint32_t instance_id;
    /** What it is, as in the column `category_id`; 0 = unlabelled. */
    uint32_t category_id;
    /** Returns of the scan that lie on it. */
    uint32_t points;
    /** 0. */
    uint32_t reserved;
    /** The middle of the box, x, y, z, metres; complete, not relative to the result's origin. */
    double position[3];
    /** Lengths along its axes, metres. */
    double size[3];
    /** Rotation from its axes, a unit quaternion x, y, z, w. */
    double orientation_xyzw[4];
    /** How fast its middle moves over the ground, m/s. */
    double velocity[3];
    /** How much of it is not hidden, 0 to 1: of the beams that would meet it if it were alone, the part that does. */
    double visible;
    /**
     * Left, top, right and bottom, pixels, of all of it in the image of the sensor, whatever hides it and where the
     * image ends; not-a-number: not asked for (scan_desc.image_boxes), or nothing of it is in front of the camera.
     */
    double image[4];
} echocast_box;

/**
 * The boxes of a result, in place. Those of a newer library may be longer than those of this header: ECHOCAST_AT steps
 * from one to the next by the stride.
 */
typedef struct echocast_box_view {
    /** The first; NULL if there are none. */
    const echocast_box *data;
    /** Number of them. */
    size_t count;
    /** Bytes from one to the next. */
    size_t stride;
} echocast_box_view;

/**
 * Gives access to the boxes around the labelled instances that a scan with `boxes` can see, in place: by rising
 * instance_id, those of appended results one after the other. Objects with one instance_id share a box. echocast_result_label_name has the names of categories and instances. The view is valid until the result is
 * scanned into, appended to or released.
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
ECHOCAST_API
echocast_status echocast_result_boxes(const echocast_result *result,
                                      echocast_box_view *out);

/* -- Images ---------------------------------------------------------------------------------------------------------- */

/** A layer of the image of a result or of pings, in place: rows from top to bottom, pixels from left to right. */
typedef struct echocast_image_view {
    /** The top left pixel; the channels of a pixel follow each other, and so do the pixels of a row. */
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

/** What an image shows of an instance. */
typedef struct echocast_image_box {
    /** The object; never 0. */
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
     * Left, top, right and bottom, pixels, of all of it, whatever hides it and where the image ends; column c reaches
     * from c to c + 1. Not-a-number: not known, as without scan_desc.image_boxes.
     */
    double amodal[4];
    /** Part of the area of the amodal box that lies outside of the image, 0 to 1; not-a-number: not known. */
    double truncation;
    /** How much of it is hidden by what is before it, 0 to 1; not-a-number: not known, as without scan_desc.boxes. */
    double occlusion;
} echocast_image_box;

/**
 * The boxes in the image of a result, in place. Those of a newer library may be longer than those of this header: ECHOCAST_AT steps
 * from one to the next by the stride.
 */
typedef struct echocast_image_box_view {
    /** The first; NULL if there are none. */
    const echocast_image_box *data;
    /** Number of them. */
    size_t count;
    /** Bytes from one to the next. */
    size_t stride;
} echocast_image_box_view;

/**
 * Gives access to a layer of the image that a camera, a spinning or a sweeping sensor sees; of several returns of a
 * beam, the nearest. Beams without a return are not-a-number, 0 or black. Layers and the columns that they show:
 *
 * - "depth": metres along the axis of a camera (`depth`), of other sensors the slant range (`range`); F32
 * - "range": slant range, metres (`range`); F32
 * - "category", "part", "instance": label numbers (`category_id`, `part_id`, `instance_id`); U32
 * - "color": base colour, sRGB (`red`, `green`, `blue`); 3 of U8
 * - "intensity": what the instrument reports (`intensity`); F32
 * - "normal": unit normals to the right, up and towards the sensor (`normal_x`, `normal_y`, `normal_z`); 3 of F32
 *
 * If the result is organised, that is all it needs, and layers of one column are not copied where the columns of a
 * camera are the image already; if not, it also needs the columns `beam` and `range`. Other layers are made when they
 * are first asked for, in memory that the result keeps for those of the next scans. echocast_sensor_get_info has the
 * size and the lens. The view is valid until the result is scanned into, appended to or released.
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
 * Gives access to what the image of a result shows of each instance, in place: by rising instance_id.
 * It is made of the layers "category" and "instance", and of the boxes of the scan for what is
 * hidden. The view is valid until the result is scanned into, appended to or released.
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

/* -- Pings ----------------------------------------------------------------------------------------------------------- */

/** Beams to the sides: waterfall and mosaic. */
#define ECHOCAST_SONAR_SIDESCAN 0

/** Beams side by side, down: bathymetry and the image of the water column. */
#define ECHOCAST_SONAR_SWATH 1

/** Beams side by side, ahead: fan. */
#define ECHOCAST_SONAR_FAN 2

/** One beam. */
#define ECHOCAST_SONAR_SINGLE 3

/** As ECHOCAST_SONAR_SIDESCAN: four beams, down and outwards, of a Doppler velocity log. */
#define ECHOCAST_SONAR_JANUS 4

/**
 * Pings of one sonar, one after the other: usually one, the last. Any number of threads may read them; only one at a
 * time may change them.
 */
typedef struct echocast_pings echocast_pings;

/** When and where a ping was sent, and how it is laid out; ECHOCAST_PING_INFO_INIT is empty. */
typedef struct echocast_ping_info {
    /** sizeof(echocast_ping_info). */
    size_t struct_size;
    /** Number of the ping: scan_desc.frame. */
    uint32_t number;
    /** How the beams lie: an ECHOCAST_SONAR_ number. */
    int32_t view;
    /** When it was sent, ns. Times since 1970 are rounded to 0.2 microseconds. */
    int64_t t_ns;
    /** Where the sonar was then, in the world; a rotating beam is turned to where it looked. */
    echocast_pose sensor_pose;
    /** World position, metres, that the columns true_x, true_y, true_z are relative to. */
    double origin[3];
    /** Beams. */
    uint32_t beams;
    /** Range bins of a beam. A ping has beams * bins cells; cell beam * bins + bin. */
    uint32_t bins;
    /** Length of a bin, metres of reported slant range: bin k reaches from k * bin_m to (k + 1) * bin_m. */
    double bin_m;
    /** Sound speed that ranges are reported with, m/s. */
    double sound_speed;
    /** First bin that reports echoes: earlier ones are nearer than the nearest range. */
    uint32_t first_bin;
    /** Level of the noise in a cell, dB re 1 uPa. */
    float noise_db;
    /**
     * Azimuth and elevation of the axis of each beam as reported, one after the other, rad, sensor frame: 2 * beams
     * numbers. This and the following are in place, like columns.
     */
    const float *axes;
    /** Lowest level that is reported as an echo, dB re 1 uPa, of each bin. */
    const float *threshold_db;
    /** Time-varied gain that pictures are drawn with, dB, of each bin; levels are without. */
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
    /** Level of the loudest cell of the echo, dB re 1 uPa. */
    float level_db;
    /** Confidence, 0 to 1; 0.5 for a standard error of 0.25 % of the range. */
    float quality;
    /**
     * Where it lies by a ray through the assumed cast of the water, relative to the origin of the ping; not-a-number
     * where that ray leaves the water.
     */
    float corrected[3];
} echocast_sounding;

/**
 * The soundings of a ping, in place. Those of a newer library may be longer than those of this header: ECHOCAST_AT
 * steps from one to the next by the stride.
 */
typedef struct echocast_sounding_view {
    /** The first; NULL if there are none. */
    const echocast_sounding *data;
    /** Number of them. */
    size_t count;
    /** Bytes from one to the next. */
    size_t stride;
} echocast_sounding_view;

/** Coordinates of the pixels of an image: the middle of column c, row r is first + {c, r} * step. */
typedef struct echocast_image_place {
    /**
     * Of the middle of the top left pixel: metres to the right of the sonar and ahead of it (of a swath sonar, above)
     * in a fan; x, y in the world on a track; metres across (starboard is positive) and the index of the ping in a
     * waterfall.
     */
    double first[2];
    /** From column to column, and from row to row. */
    double step[2];
} echocast_image_place;

/**
 * Sends one ping of a sonar. `*io`: NULL, and it becomes a new list of this ping, to be released with
 * echocast_pings_release; or a list, which has only this ping from then on, in its memory: after the first of their
 * kind, pings take up to 20 small blocks, whatever the number of rays and cells.
 *
 * `desc` is as for echocast_scan, which gives the points of the same ping, and its `frame` is the number of the ping.
 * Of its columns a ping has `intensity`, the level, and those among `category_id`, `part_id`, `instance_id`,
 * `material_id`, `time`, `azimuth`, `elevation`, `red`, `green`, `blue`, `normal_x` to `normal_z`, `cos_incidence`,
 * `true_x` to `true_z`, `true_range`, `cause`, `bounces`, `velocity_x` to `velocity_z`, `radial_velocity`, `flow_x` to
 * `flow_z` that are asked for: what the strongest scatterer in the cell is; numbers are not-a-number and labels 0
 * where nothing scatters. What `desc` says of points alone is not used: organised, coordinates, order, boxes,
 * progress.
 *
 * On an error in the arguments, an old list stays as it was; one for which there was no memory is empty.
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
 * the list is pinged into or released.
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
 * Gives access to a column of a ping, counted from 0, without copying it: beams * bins numbers, all bins of a beam one
 * after the other. `column`: "intensity" for the levels, dB re 1 uPa, as ECHOCAST_TYPE_F32, or another that was asked
 * for. The view is valid until the list is pinged into or released.
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
 * Gives access to what a ping, counted from 0, reports as depths, in place: by rising beam; none for side-scan and
 * imaging sonars. The view is valid until the list is pinged into, appended to or released.
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
 * offset; so ROS has images of sonars, and the columns of a ping have them the other way round. Numbers are converted
 * as in echocast_result_pack, and the other arguments are the same; `*needed` is stride * beams * bins.
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
 * Valid until the list is pinged into or released.
 */
ECHOCAST_API
const char *echocast_pings_label_name(const echocast_pings *pings,
                                      const char *table,
                                      uint32_t number);

/**
 * Gets the number that has a name in a label column. `table`: "category", "part", "material" or "instance", where the
 * first instance of the name counts.
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
 * Gives access to the pixels of a picture of all pings, in place. `options`: YAML with `view`: "fan" lays the last
 * ping of an imaging or swath sonar, or all of a beam that turns, out by beam and range; "waterfall" has a row for
 * each ping; "track" is the map that they make, of a swath sonar that of its depths; further `width` (1600), 320 to
 * 4096 pixels, and `ground` (false), whether a waterfall shows ground range. `layer`: "values", levels with the
 * sonar's time-varied gain, dB re 1 uPa, or heights on the map of depths, metres, not-a-number where nothing is, as
 * ECHOCAST_TYPE_F32; or a label column of the pings, such as "category_id", 0 where nothing is, as ECHOCAST_TYPE_U32.
 * `place` may be NULL. Each picture is made when it is first asked for; the view is valid until the list is pinged
 * into, appended to or released.
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

/* -- Scenarios ------------------------------------------------------------------------------------------------------- */

/**
 * A sample of a scenario: its scene as it was drawn, and the scans of its sensors. Any number of threads may read it;
 * only one at a time may scan it.
 */
typedef struct echocast_sample echocast_sample;

/**
 * A file that makes samples: a scene, a rig of sensors, and what differs from sample to sample. Any number of threads
 * may make samples of it; only one at a time may change it.
 */
typedef struct echocast_scenario echocast_scenario;

/** What one sensor of the rig does in a sample; ECHOCAST_SCAN_INFO_INIT is empty. */
typedef struct echocast_scan_info {
    /** sizeof(echocast_scan_info). */
    size_t struct_size;
    /** Its frames; of a sonar, its pings. */
    size_t frames;
    /**
     * Where the name of the sensor in the rig is written, ending in 0, cut off if it is too long; NULL if not wanted.
     * Set by the caller.
     */
    char *name;
    /** Capacity of `name`, bytes. Set by the caller. */
    size_t name_capacity;
} echocast_scan_info;

/** When a frame is scanned; ECHOCAST_FRAME_INFO_INIT is empty. */
typedef struct echocast_frame_info {
    /** sizeof(echocast_frame_info). */
    size_t struct_size;
    /** Its start, ns since the start of the run, from which the column `time` counts. */
    int64_t start_ns;
    /** How long the sensor looks at the scene at most, ns. */
    int64_t duration_ns;
    /** Its number, as in the column `frame`. */
    uint32_t number;
    /** 0. */
    uint32_t reserved;
} echocast_frame_info;

/**
 * Reads a scenario file, or the report of `echocast scan --json`. Names of files in it are relative to its folder, or
 * to its `folder`. Scenes and models are read with the first sample that needs them, and kept for the others. What it
 * says under `outputs` is for the program and not used here.
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
 * Like echocast_scenario_load, from YAML text with the contents of a scenario file. `folder`: where relative paths in
 * it start; NULL for the working folder.
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
 * YAML. Samples that were made stay as they are; the next one reads its scene and models again.
 *
 * Errors: ECHOCAST_E_PARSE (key, what was found, what is allowed), ECHOCAST_E_IO, ECHOCAST_E_ARGUMENT,
 * ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY (another thread makes a sample); the scenario is then unchanged.
 */
ECHOCAST_API
echocast_status echocast_scenario_set(echocast_scenario *scenario,
                                      const char *key,
                                      const char *value);

/**
 * Writes the number of samples that a scenario asks for to `*out`.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API echocast_status echocast_scenario_samples(const echocast_scenario *scenario, uint64_t *out);

/**
 * Makes a sample, counted from 0: draws what varies and sets up its scene and scans. It is the same alone, in any
 * order, on any thread, and the one that `echocast run` writes; there may be more than the scenario asks for, up to
 * number 4294967295. `*out` is the new sample; release it with echocast_sample_release. What was noticed is reported
 * to the context's log: objects that found no room, what scene files lack.
 *
 * Any number of threads may make samples of one scenario: in a context of one thread side by side; a context of
 * several gives all its threads to one sample after the other.
 *
 * Errors: ECHOCAST_E_IO, ECHOCAST_E_PARSE (file and place), ECHOCAST_E_UNSUPPORTED, ECHOCAST_E_ARGUMENT (a value that
 * was drawn and is not allowed, no room for what must be placed), ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY,
 * ECHOCAST_E_BUSY (another thread changes the scenario).
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
 * Gets information on a scan, counted from 0 in the order of the rig. The caller sets struct_size of `*info`, and
 * where the name is to go.
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
 * Gives a copy of the sensor of a scan, with all that was drawn for it: `*out` is a sensor like any other, to be
 * released with echocast_sensor_release.
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
 * Says which boxes the following scans of a sample have: `boxes` and `image_boxes` as in echocast_scan_desc; at first
 * none. When they hold, the scenario says (`boxes`).
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
 * Scans a frame of a sample as the scenario says: scan and frame are counted from 0; a sonar sends the ping of that
 * number. `columns`: NULL for those that the scenario asks for (`fields`); else names as in echocast_scan_desc, where
 * "default" stands for these. `*io`: NULL, and it becomes a new result, or a result, whose memory is reused, as for
 * echocast_scan. Frames may be scanned in any order and again: the points are the same.
 *
 * One thread at a time may scan a sample; each may scan one of its own.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY, ECHOCAST_E_BUSY. On an error in the arguments, an
 * old result stays as it was; when there was no memory for a scan, it is empty.
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
 * Sends a ping of a sonar of a sample as the scenario says: as echocast_sample_scan, but into a list of pings, as
 * echocast_ping does.
 *
 * Errors: ECHOCAST_E_ARGUMENT (a scan whose sensor is not a sonar), ECHOCAST_E_HANDLE, ECHOCAST_E_MEMORY,
 * ECHOCAST_E_BUSY. On an error in the arguments, an old list stays as it was; one for which there was no memory is
 * empty.
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
 * beside it, which gets its name just before; an error leaves both as they were. What a format cannot hold is reported
 * to the context's log.
 *
 * Errors: ECHOCAST_E_ARGUMENT, ECHOCAST_E_IO (a full disk), ECHOCAST_E_UNSUPPORTED, ECHOCAST_E_HANDLE,
 * ECHOCAST_E_BUSY.
 */
ECHOCAST_API echocast_status echocast_result_write(const echocast_result *result, const char *path, const char *format);

/**
 * Writes a picture of the points as PNG (`.png`). `options`: NULL, or YAML with `view` (top, perspective, range), `color`
 * (label, cause, intensity, range, height, velocity, radial_velocity, doppler, density) and `width` in pixels. The
 * result needs the columns that colours are made of; without them other colours are taken, with a warning to the log.
 * With the column `cause`, points of rain, fog and the like have their own colours.
 *
 * Errors: ECHOCAST_E_ARGUMENT (a view that points do not have, a width out of bounds), ECHOCAST_E_PARSE,
 * ECHOCAST_E_UNSUPPORTED (another ending), ECHOCAST_E_IO, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 */
ECHOCAST_API
echocast_status echocast_result_preview(const echocast_result *result,
                                        const char *path,
                                        const char *options);

/**
 * Writes all that the pings hold to a file, as NPZ (`.npz`) or HDF5 (`.h5`, `.hdf5`), as the ending of `path` says:
 * arrays of pings x beams x bins, soundings, and what they have in common. It appears under its name only when it is
 * complete and on the disk. What the format cannot hold is reported to the context's log.
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
 * Writes a picture of the pings as PNG (`.png`), with scales and a legend. `options`: YAML with `view`, `width` and `ground` as
 * for echocast_pings_image, and `color` (label, intensity); pings without labels are coloured by intensity, with a
 * warning to the log.
 *
 * Errors: ECHOCAST_E_ARGUMENT (a view that this sonar does not have, a width out of bounds), ECHOCAST_E_PARSE,
 * ECHOCAST_E_UNSUPPORTED (another ending), ECHOCAST_E_IO, ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
 *
 * ```c
 * echocast_pings_preview(pings, "fan.png", "{view: fan, color: intensity}");
 * ```
 */
ECHOCAST_API
echocast_status echocast_pings_preview(const echocast_pings *pings,
                                       const char *path,
                                       const char *options);

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
