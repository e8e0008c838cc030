# find_package(bottomlock) gives bottomlock::bottomlock, the shared library, and bottomlock::static. Paths are relative to this file.
get_filename_component(_bottomlock_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)

if(NOT TARGET bottomlock::bottomlock)
    add_library(bottomlock::bottomlock SHARED IMPORTED)
    set_target_properties(bottomlock::bottomlock PROPERTIES
        IMPORTED_LOCATION "${_bottomlock_prefix}/lib/@SHARED@"
        IMPORTED_SONAME "@SONAME@"
        INTERFACE_INCLUDE_DIRECTORIES "${_bottomlock_prefix}/include")
    add_library(bottomlock::static STATIC IMPORTED)
    set_target_properties(bottomlock::static PROPERTIES
        IMPORTED_LOCATION "${_bottomlock_prefix}/lib/libbottomlock.a"
        INTERFACE_LINK_LIBRARIES "@STATIC_LIBS@"
        INTERFACE_INCLUDE_DIRECTORIES "${_bottomlock_prefix}/include")
endif()
unset(_bottomlock_prefix)
