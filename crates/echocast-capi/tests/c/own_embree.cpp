// A host that opens an Embree of its own before or after its first scan, and uses it between scans; see
// scripts/test-embrees. usage: host SCENE (none | LIBRARY) (first | last | preloaded)
#include <echocast.hpp>

#include <cstdio>
#include <cstring>
#include <dlfcn.h>

static void use_own(const char *library)
{
    if (!std::strcmp(library, "none"))
        return;
    void *opened = dlopen(library, RTLD_NOW | RTLD_GLOBAL);
    if (!opened) {
        std::fprintf(stderr, "%s\n", dlerror());
        std::exit(1);
    }
    auto create = reinterpret_cast<void *(*)(const char *)>(dlsym(opened, "rtcNewDevice"));
    auto release = reinterpret_cast<void (*)(void *)>(dlsym(opened, "rtcReleaseDevice"));
    if (!release) // Embree 2
        release = reinterpret_cast<void (*)(void *)>(dlsym(opened, "rtcDeleteDevice"));
    void *device = create ? create(nullptr) : nullptr;
    if (!device || !release) {
        std::fprintf(stderr, "%s: has no device\n", library);
        std::exit(1);
    }
    release(device);
}

static void scan(const char *path)
{
    echocast::context context(2);
    echocast::scene scene(context);
    scene.load(path);
    echocast::sensor sensor(context, "velodyne_vlp16");
    const echocast_pose here = {{1, 0, 0, -6, 0, 1, 0, 6, 0, 0, 1, 1.2}};
    std::printf("%zu points\n", echocast::scan(scene.commit(), sensor, here).size());
}

int main(int, char **argv)
try {
    if (!std::strcmp(argv[3], "first"))
        use_own(argv[2]);
    scan(argv[1]);
    use_own(argv[2]);
    scan(argv[1]);
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
