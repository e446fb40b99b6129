// A scene: mesh, handles, material, environment and motion.
using System;

namespace Selvedge
{
    /// <summary>A scene. Steppers that were made of it go on after it is disposed of.</summary>
    public sealed class Scene : IDisposable
    {
        private ulong handle;

        /// <summary>Opens a scene by the path of its file or the name of a shipped one.</summary>
        /// <exception cref="SelvedgeException">Says what of the scene is wrong.</exception>
        public Scene(string pathOrName)
        {
            Native.CheckInterface();
            Native.Check(Native.selvedge_scene_open(Native.Bytes(pathOrName), out handle));
        }

        /// <summary>Frees a scene that nobody disposed of.</summary>
        ~Scene()
        {
            Free();
        }

        /// <summary>What the scene asks for and cannot have, or hardly means.</summary>
        public string[] Warnings
        {
            get
            {
                var lines = Native.Lines((byte[] text, UIntPtr room, out UIntPtr needed) =>
                    Native.selvedge_scene_warnings(handle, text, room, out needed));
                GC.KeepAlive(this);
                return lines;
            }
        }

        internal ulong Handle
        {
            get { return handle; }
        }

        /// <summary>Frees the scene.</summary>
        public void Dispose()
        {
            Free();
            GC.SuppressFinalize(this);
        }

        // The number stays, so that a later call is told that it was freed.
        private void Free()
        {
            if (handle != 0) Native.selvedge_scene_free(handle);
        }
    }
}
