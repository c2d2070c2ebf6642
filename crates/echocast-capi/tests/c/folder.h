/* The folder that a test program writes into. */
#ifndef FOLDER_H
#define FOLDER_H

#include <stdio.h>

static char folder[4096];

static inline const char *in_folder(const char *name)
{
    static char path[8192];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static inline int exists(const char *path)
{
    FILE *file = fopen(path, "rb");
    if (file)
        fclose(file);
    return file != NULL;
}

#endif
