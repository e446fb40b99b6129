// A call of the library that failed.
using System;

namespace Selvedge
{
    /// <summary>A call that failed; the message has the library's words.</summary>
    public sealed class SelvedgeException : Exception
    {
        internal SelvedgeException(Status status, string words)
            : base(words)
        {
            Status = status;
        }

        /// <summary>The code of the call.</summary>
        public Status Status { get; }
    }

    /// <summary>What is one for the whole process.</summary>
    public static class Library
    {
        /// <summary>Version of the library.</summary>
        public static string Version
        {
            get { return Native.Text(Native.selvedge_version()); }
        }

        /// <summary>Sets the number of threads for all steppers, before the first is made.</summary>
        public static void SetThreads(int threads)
        {
            Native.Check(Native.selvedge_set_threads((UIntPtr)(uint)Math.Max(threads, 0)));
        }

        /// <summary>Keeps rest poses in a folder, so that the same cloth starts at once another
        /// time.</summary>
        public static void KeepRestPoses(string folder)
        {
            Native.Check(Native.selvedge_keep_rest_poses(Native.Bytes(folder)));
        }
    }
}
