/* A host with an Embree of its own, whose functions are in this program: none of the library's calls reach them, nor do
 * those between Embree's own functions. And without an Embree, or with one that is not, contexts say why they are not
 * made. argv[1]: a folder for files. */
#define _POSIX_C_SOURCE 200809L
#include "check.h"

/* Exported, as those of a library that the host is linked to are: see the options in programs.rs. */
#define OURS(name)                                                                                                     \
    void name(void);                                                                                                   \
    void name(void)                                                                                                    \
    {                                                                                                                  \
        fprintf(stderr, "the library called the host's " #name "\n");                                                  \
        abort();                                                                                                       \
    }
OURS(rtcNewDevice)
OURS(rtcReleaseDevice)
OURS(rtcRetainDevice)
OURS(rtcGetDeviceProperty)
OURS(rtcGetDeviceError)
OURS(rtcNewScene)
OURS(rtcReleaseScene)
OURS(rtcCommitScene)
OURS(rtcJoinCommitScene)
OURS(rtcNewGeometry)
OURS(rtcCommitGeometry)
OURS(rtcAttachGeometry)
OURS(rtcAttachGeometryByID)
OURS(rtcSetNewGeometryBuffer)
OURS(rtcIntersect1)
OURS(rtcIntersect4)
OURS(rtcIntersect8)
OURS(rtcIntersect16)

static void scan_a_box(void)
{
    echocast_context *context;
    OK(echocast_context_create(NULL, &context));
    scan_around(context, box(context), at(5, 0, 0));
    echocast_context_release(context);
}

static void search(const char *place, const char *text)
{
    echocast_context *context = NULL;
    setenv("ECHOCAST_EMBREE", place, 1);
    FAILS(ECHOCAST_E_UNSUPPORTED, text, echocast_context_create(NULL, &context));
    CHECK(context == NULL);
}

int main(int argc, char **argv)
{
    char path[4096];
    CHECK(argc == 2);
    search(argv[1], "Embree 4.3 or a later 4.x is missing: ");
    snprintf(path, sizeof path, "%s/none.so", argv[1]);
    search(path, path);
    /* A library, but of something else. */
    search("libm.so.6", "libm.so.6: cannot be used as Embree: ");
    unsetenv("ECHOCAST_EMBREE");
    scan_a_box();
    scan_a_box();
    puts("passed");
    return 0;
}
